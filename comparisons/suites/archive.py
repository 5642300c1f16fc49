"""What a suite left in its folder, read again."""

import json
from pathlib import Path
from typing import Any, NamedTuple

from comparisons.record import CASE, RecordError, read_case
from comparisons.results import Case
from comparisons.suites.suite import folder_name
from reference_rt.files import read_text


class Archive(NamedTuple):
    """The cases with their pictures, in order; what they were made with; the suite's name; and why
    other cases were not run, by name."""

    cases: tuple[Case, ...]
    provenance: dict[str, Any]
    suite: str | None
    not_run: dict[str, str]


def read_archive(folder: Path) -> Archive:
    """The cases that `results.json` in the folder names, from their records; where there is no such
    file all records.  Raises RecordError."""
    path = folder / "results.json"
    records = folder / "cases"
    try:
        told = json.loads(read_text(path))
        names = [folder_name(case["scene"]) for case in told["cases"]]
        provenance, suite, not_run = told["provenance"], told["suite"], told["not_run"]
    except FileNotFoundError:
        names = sorted(record.parent.name for record in records.glob(f"*/{CASE}"))
        provenance, suite, not_run = {}, None, {}
    except OSError as error:
        raise RecordError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, TypeError, RecursionError):
        raise RecordError(f"{path}: is not what a suite writes; expected its results") from None
    if not names:
        raise RecordError(f"{folder}: holds no case; expected what `reference-rt suite` wrote")
    return Archive(tuple(read_case(records / n) for n in names), provenance, suite, not_run)

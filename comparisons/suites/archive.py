"""What `suite` or `compare` left in its folder, read again."""

import json
from pathlib import Path
from typing import Any, NamedTuple

from comparisons.results.case import Case
from comparisons.results.record import CASE, RecordError, read_case
from comparisons.suites.work import folder_name
from reference_rt.util.files import read_text


class Archive(NamedTuple):
    """The cases with their pictures, in order; what they were made with; the suite's name; why
    other cases were not run, by name; and those that are missing, because the run was
    interrupted."""

    cases: tuple[Case, ...]
    provenance: dict[str, Any]
    suite: str | None
    not_run: dict[str, str]
    missing: tuple[str, ...] = ()


def check_archive(folder: Path) -> None:
    """Raise RecordError where there is nothing that `read_archive` could read."""
    if not (folder / "results.json").exists() and not (folder / "cases").is_dir():
        raise RecordError(
            f"{folder}: holds no case; expected what `reference-rt suite` or `compare` wrote"
        )


def read_archive(folder: Path) -> Archive:
    """The cases that `results.json` in the folder names, from their records; where there is no such
    file all records.  Raises RecordError."""
    path = folder / "results.json"
    records = folder / "cases"
    missing: tuple[str, ...] = ()
    try:
        told = json.loads(read_text(path))
        names = [folder_name(case["scene"]) for case in told["cases"]]
        provenance, suite, not_run = told["provenance"], told["suite"], told["not_run"]
        missing = tuple(told.get("missing", ()))
    except FileNotFoundError:
        names = sorted(record.parent.name for record in records.glob(f"*/{CASE}"))
        provenance, suite, not_run = {}, None, {}
    except OSError as error:
        raise RecordError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, TypeError, RecursionError):
        raise RecordError(f"{path}: is not what a suite writes; expected its results") from None
    if not names and not missing:
        raise RecordError(
            f"{folder}: holds no case; expected what `reference-rt suite` or `compare` wrote"
        )
    cases = tuple(read_case(records / name) for name in names)
    return Archive(cases, provenance, suite, not_run, missing)

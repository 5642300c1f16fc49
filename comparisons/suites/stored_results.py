"""Reads the output folder of `suite` or `compare` again."""

import json
from pathlib import Path
from typing import Any, NamedTuple

from comparisons.results.case import Case
from comparisons.results.stored_case import CASE, StoredCaseError, read_case
from comparisons.suites.work import folder_name
from reference_rt.util.files import read_text


class StoredResults(NamedTuple):
    """cases: with their pictures, in order;  provenance: versions, machine, date;  suite: its name;
    not_run: why other cases were skipped, by name;  missing: names of cases that an interrupted run
    did not reach."""

    cases: tuple[Case, ...]
    provenance: dict[str, Any]
    suite: str | None
    not_run: dict[str, str]
    missing: tuple[str, ...] = ()


def check_stored_results(folder: Path) -> None:
    """Raise RecordError if the folder has nothing that `read_stored_results` could read."""
    if not (folder / "results.json").exists() and not (folder / "cases").is_dir():
        raise _no_case(folder)


def read_stored_results(folder: Path) -> StoredResults:
    """The stored results of the cases that the folder's `results.json` names; without that file,
    all stored results.  Raises RecordError."""
    path = folder / "results.json"
    records = folder / "cases"
    missing: tuple[str, ...] = ()
    try:
        results = json.loads(read_text(path))
        names = [folder_name(case["scene"]) for case in results["cases"]]
        provenance, suite, not_run = results["provenance"], results["suite"], results["not_run"]
        missing = tuple(results.get("missing", ()))
    except FileNotFoundError:
        names = sorted(record.parent.name for record in records.glob(f"*/{CASE}"))
        provenance, suite, not_run = {}, None, {}
    except OSError as error:
        raise StoredCaseError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, TypeError, RecursionError):
        raise StoredCaseError(f"{path}: was not written by `suite` or `compare`") from None
    if not names and not missing:
        raise _no_case(folder)
    cases = tuple(read_case(records / name) for name in names)
    return StoredResults(cases, provenance, suite, not_run, missing)


def _no_case(folder: Path) -> StoredCaseError:
    return StoredCaseError(
        f"{folder}: has no cases; expected the output folder of `reference-rt suite` or `compare`"
    )

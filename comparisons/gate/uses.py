"""What is noted of a use of a gate in a pytest session.  Imports nothing but pytest until then."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from comparisons.gate.material import Check
    from comparisons.results.case import Case

Use = dict[str, Any]
"""A use of a gate, in JSON's types: "test" (pytest's id), "fixture", "call" (of any gate in the
test, from 1), "verdict" (a case's, or "error" of what could not be judged), "passed", "headline",
"reason", "cause" (name and evidence, or null), "z", "folder" (of the use's own outputs, or ""),
"pictures" (URLs and titles), "seconds", and in the session's process "outcome" (of the test, up to
here)."""

USES = pytest.StashKey[list[Use]]()


def note(item: pytest.Item, fixture: str, call: int, **what: Any) -> None:
    """Note a use;  what: the other values of a `Use`."""
    use = {"test": item.nodeid, "fixture": fixture, "call": call, "folder": ""}
    use |= {"headline": "", "reason": "", "cause": None, "z": None, "pictures": [], "seconds": 0.0}
    item.stash.setdefault(USES, []).append(use | what)


def key_of(use: Use) -> str:
    """The name of a use, the same in each session."""
    number = "" if use["call"] == 1 else f" {use['call']}"
    return f"{use['test']} ({use['fixture']}{number})"


def of_case(case: "Case", passed: bool) -> Use:
    """What is noted of a case."""
    from comparisons.report.thumbnails import small_pictures
    from comparisons.results.files import plain
    from comparisons.results.headline import headline

    cause = None
    if case.cause is not None:
        cause = {"name": case.cause.name, "evidence": case.cause.evidence}
    return {
        "verdict": case.verdict,
        "passed": passed,
        "headline": headline(case),
        "reason": case.reason,
        "cause": cause,
        "z": plain(z_of(case)),
        "pictures": small_pictures(case),
    }


def of_checks(checks: "Sequence[Check]", pictures: Sequence[Path]) -> Use:
    """What is noted of the checks of a material.  pictures: files of what is wrong."""
    from comparisons.report.thumbnails import shrunk_url

    failed = [check for check in checks if not check]
    reasons = [f"{check.name}: {check.reason}" for check in failed or checks]
    return {
        "verdict": "differ" if failed else "agree",
        "passed": not failed,
        "headline": "; ".join(reasons[:1]) if failed else "no check found anything",
        "reason": "; ".join(reasons),
        "folder": str(pictures[0].parent) if pictures else "",
        "pictures": [(shrunk_url(path), path.stem) for path in pictures],
    }


def z_of(case: "Case") -> float | None:
    """The bias of the image mean in standard errors, of the channel that is farthest from zero;
    None without noise."""
    for rung in case.rungs:
        biases, errors = (
            rung.numbers.get(key) for key in ("relative_bias", "standard_error_of_bias")
        )
        if isinstance(biases, dict) and isinstance(errors, dict):
            pairs = [(b, errors.get(name)) for name, b in biases.items()]
            found = [bias / error for bias, error in pairs if bias is not None and error]
            return max(found, key=abs, default=None)
    return None

"""What gates said in former sessions: a small file for each session, and the tests whose verdict
has changed over the last ones."""

import datetime
import json
import os
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from comparisons.gate.uses import Use, key_of
from comparisons.results.files import write_json
from reference_rt.util.files import discard, read_text
from reference_rt.util.processes import tied

LOOKED_AT = 20
"""Sessions over which a change of a verdict counts."""

KEPT = 100
"""Sessions whose files are kept."""

SCHEMA = 1


@dataclass(frozen=True)
class Once:
    """What a gate said in one session.  commit: that of the repository around the tests, "" if it
    is unknown or had other changes."""

    date: str
    commit: str
    verdict: str
    passed: bool
    z: float | None


@dataclass(frozen=True)
class Past:
    """What a gate said in the last sessions, the newest last."""

    runs: tuple[Once, ...]

    @property
    def changes(self) -> int:
        """How often the verdict is another one than in the session before."""
        return sum(a.verdict != b.verdict for a, b in zip(self.runs, self.runs[1:], strict=False))

    @property
    def same_source(self) -> bool:
        """Whether the verdict has changed where the source has not."""
        verdicts: dict[str, set[str]] = {}
        for run in self.runs:
            verdicts.setdefault(run.commit, set()).add(run.verdict)
        return any(commit and len(found) > 1 for commit, found in verdicts.items())

    @property
    def words(self) -> str:
        """Such as "agree ×4, differ ×1, agree ×2: changed 2 times"."""
        groups: list[list[Any]] = []
        for run in self.runs:
            if groups and groups[-1][0] == run.verdict:
                groups[-1][1] += 1
            else:
                groups.append([run.verdict, 1])
        told = ", ".join(f"{verdict} ×{count}" for verdict, count in groups)
        if not self.changes:
            return told
        times = "once" if self.changes == 1 else f"{self.changes} times"
        same = ", also without a change of the source" if self.same_source else ""
        return f"{told}: changed {times}{same}"


def added(folder: Path, uses: Sequence[Use], root: Path) -> dict[str, Past]:
    """Store the verdicts of a session, and return what each of its uses said in the last sessions,
    this one included, by `key_of`.  Files of sessions before the last KEPT are removed, and files
    that are damaged ignored.  root: the folder of the tests.  Raises ImageError."""
    now = datetime.datetime.now(datetime.UTC)
    said = {key_of(use): {key: use[key] for key in ("verdict", "passed", "z")} for use in uses}
    run = {"schema": SCHEMA, "date": now.isoformat(timespec="seconds"), "commit": _commit(root)}
    write_json(folder / f"run-{now:%Y%m%dT%H%M%S.%fZ}-{os.getpid()}.json", {**run, "uses": said})
    files = sorted(folder.glob("run-*.json"))
    for old in files[:-KEPT]:
        discard(old)
    runs = [found for path in files[-LOOKED_AT:] if (found := _read(path)) is not None]
    return {name: Past(tuple(one[name] for one in runs if name in one)) for name in said}


def _read(path: Path) -> dict[str, Once] | None:
    """The uses of a session by `key_of`; None for a file that is none of ours."""
    with suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
        run = json.loads(read_text(path))
        if run["schema"] == SCHEMA:
            when = run["date"], run["commit"]
            return {name: Once(*when, **use) for name, use in run["uses"].items()}
    return None


def _commit(root: Path) -> str:
    """The commit of the repository around `root`; "" if there is none, or if files have changed
    since."""
    words = ["git", "-C", str(root), "describe", "--always", "--dirty=+", "--abbrev=40"]
    words.append("--exclude=*")
    with suppress(OSError, subprocess.TimeoutExpired):
        found = subprocess.run(words, capture_output=True, timeout=10, check=False, **tied())
        told = found.stdout.decode().strip()
        return "" if found.returncode or told.endswith("+") else told
    return ""

"""The engine of experiments: what is stored is read, the rest is measured and stored, and counted.

What they have in common: an experiment is a list of requests.  Each has a key, the hash of all that
its result depends on, and a place of its own in the output folder.  What is stored there with this
key is read; everything else is measured, in worker processes that may crash or hang (`processes`),
and each result is stored, whole, as soon as it is there, so that a run that was interrupted goes
on.  Tables, results and the page are written from all of them, each whole or not at all.

What differs is the experiment's own: what its requests ask for, what a result holds and the file
that it is in, what becomes of a request that failed, and what is shown.
"""

import hashlib
import json
from collections.abc import Callable, Generator, Hashable, Sequence
from contextlib import closing, suppress
from pathlib import Path
from typing import Any, TypeVar

from rich.progress import MofNCompleteColumn, TimeElapsedColumn

from comparisons.results.files import plain, sealed, unsealed
from comparisons.runs import processes
from comparisons.runs.processes import Children, Ended, R
from reference_rt.util.console import Bar
from reference_rt.util.files import read_text, replacing
from reference_rt.util.workers import Workers

T = TypeVar("T")


def key_of(**parts: Any) -> str:
    """SHA-256 of what a result depends on."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def store(path: Path, key: str, value: Any) -> None:
    """Store a result in a file, whole or not at all.

    value: of JSON's and NumPy's types, and dataclasses; infinity and NaN too: no other program
    reads the file.
    """
    document = sealed({"key": key, "value": plain(value, lambda number: number)})
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(document, indent=1), encoding="utf-8")


def stored(path: Path, key: str) -> Any:
    """The result in a file; None where there is none of this key, or the file is damaged."""
    with suppress(OSError, ValueError, KeyError, RecursionError):
        document = unsealed(json.loads(read_text(path)))
        return document["value"] if document["key"] == key else None
    return None


def known(
    requests: Sequence[R], read: Callable[[R], T | None], fresh: bool = False
) -> tuple[list[tuple[R, T]], list[R]]:
    """Those whose results are stored, with these; and the others, which are all if `fresh`.

    read: the stored result of a request, None where there is none.
    """
    done, left = [], []
    for request in requests:
        found = None if fresh else read(request)
        if found is None:
            left.append(request)
        else:
            done.append((request, found))
    return done, left


def measured(
    requests: Sequence[R],
    read: Callable[[R], T | None],
    workers: Workers,
    seconds: float,
    module: Sequence[str],
    *,
    kin: Callable[[R], Hashable] = lambda request: None,
    doing: Callable[[R, str], None] = lambda request, step: None,
    children: Children | None = None,
) -> Generator[tuple[R, T | None, Ended], None, None]:
    """(request, result, how its process ended) as they end; None for the result of one that failed.

    read: see `known`;  the others as `processes.run` has them.
    """
    some = requests, workers, seconds, doing, module
    with closing(processes.run(*some, kin, children)) as running:
        for ended in running:
            yield ended.request, None if ended.failure else read(ended.request), ended


class Count(Bar):
    """Shows on standard error how many results there are, of how many; None: of any number."""

    def __init__(self, total: int | None) -> None:
        super().__init__(MofNCompleteColumn(), TimeElapsedColumn())
        self._task = self._bar.add_task("", total=total)

    def count(self, words: str, ended: int = 1) -> None:
        """So many more;  words: beside the bar."""
        self._bar.update(self._task, advance=ended, description=words)

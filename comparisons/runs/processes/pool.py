"""Requests carried out by child processes, on this machine or on those of a cluster: one that dies
or hangs is replaced, and the others go on."""

import json
import queue
from collections import Counter
from collections.abc import Callable, Generator, Hashable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Generic, Protocol, TypeVar

from comparisons.runs.elsewhere import check_sources
from comparisons.runs.processes.child import Children, Ended
from comparisons.runs.provenance import everything_fingerprint
from reference_rt.util.files import replacing, temporary_folder
from reference_rt.util.workers import Threads, Workers, run_all


class Request(Protocol):
    """What is asked for, as one line of JSON.  output: the name of its field that says which file
    or folder is written."""

    output: ClassVar[str]

    def model_dump_json(self) -> str: ...


R = TypeVar("R", bound=Request)


@dataclass(frozen=True)
class Outcome(Ended, Generic[R]):
    """How a request ended; see `Ended`."""

    request: R


def run(
    requests: Sequence[R],
    workers: Workers,
    seconds: float,
    progress: Callable[[R, str], None],
    module: Sequence[str],
    kin: Callable[[R], Hashable] = lambda request: None,
) -> Generator[Outcome[R], None, None]:
    """Have requests carried out, and yield outcomes as they come.

    workers: `Threads` of this process, each with a child process, or those of a cluster, whose
    workers have child processes of their own and send back the files that these write;  seconds:
    time limit of a request;  progress: called with a request and what is being done for it, ""
    when it begins; steps are not reported by clusters;  module: of a worker that keeps to
    `protocol`, and options of its command line;  kin: requests of equal kin need the same kernels:
    on this machine they follow each other, see `_Turns`.  Closing the iterator ends the processes
    of this machine.  Raises ReferenceUnavailableError where none can be carried out; WorkersError.
    """
    if isinstance(workers, Threads):
        with closing(_run_here(requests, workers, seconds, progress, module, kin)) as found:
            yield from found
        return
    folder, sources = str(Path.cwd()), everything_fingerprint()

    def tasks() -> Iterator[tuple[Any, ...]]:
        for request in requests:
            progress(request, "")
            asked = json.loads(request.model_dump_json())
            yield asked, request.output, tuple(module), seconds, folder, sources

    with closing(run_all(workers, carry_out_remotely, tasks())) as results:
        for number, (ended, files) in results:
            request = requests[number]
            _store(files, Path(getattr(request, request.output)).parent)
            yield Outcome(**vars(ended), request=request)


class _Turns(Generic[R]):
    """Hands out the first of those requests of whose kin the fewest run: two processes would both
    compile the kernels that the first one stores for the others."""

    def __init__(self, requests: Sequence[R], kin: Callable[[R], Hashable]) -> None:
        self._kin, self._left = kin, list(requests)
        self._running: Counter[Hashable] = Counter()

    def __iter__(self) -> Iterator[tuple[R]]:
        def running(number: int) -> int:
            return self._running[self._kin(self._left[number])]

        while self._left:
            request = self._left.pop(min(range(len(self._left)), key=running))
            self._running[self._kin(request)] += 1
            yield (request,)

    def ended(self, request: R) -> None:
        self._running[self._kin(request)] -= 1


def _run_here(
    requests: Sequence[R],
    workers: Threads,
    seconds: float,
    progress: Callable[[R, str], None],
    module: Sequence[str],
    kin: Callable[[R], Hashable],
) -> Generator[Outcome[R], None, None]:
    turns = _Turns(requests, kin)
    steps: queue.SimpleQueue[tuple[R, str]] = queue.SimpleQueue()

    def watch() -> None:
        while not steps.empty():
            progress(*steps.get())

    with closing(Children()) as children:

        def carry_out(request: R) -> Outcome[R]:
            ended = children.carry_out(
                tuple(module),
                "",
                request.model_dump_json(),
                seconds,
                lambda step: steps.put((request, step)),
            )
            return Outcome(**vars(ended), request=request)

        with closing(run_all(workers, carry_out, turns, watch)) as results:
            for _, outcome in results:
                watch()
                turns.ended(outcome.request)
                yield outcome


# ---- on other machines --------------------------------------------------------------------------

_children = Children()
"""Of this process, a worker of a cluster: they go on with the next request."""


def carry_out_remotely(
    asked: dict[str, Any],
    output: str,
    module: tuple[str, ...],
    seconds: float,
    folder: str,
    sources: str,
) -> tuple[Ended, dict[str, bytes]]:
    """Carry out a request in this process, a worker of a cluster.  Returns how it ended, and the
    contents of the files that were written, by their paths from the folder of its output.

    asked, output: the request and the name of its field, see `Request`;  folder: the current one of
    who asks, which relative paths begin in;  sources: fingerprint of what verdicts depend on.
    Raises WorkersError if these differ here; ReferenceUnavailableError.
    """
    check_sources(sources)
    with temporary_folder() as root:
        asked = {**asked, output: str(root / Path(asked[output]).name)}
        ended = _children.carry_out(module, folder, json.dumps(asked), seconds, lambda step: None)
        written = [path for path in root.rglob("*") if path.is_file()]
        return ended, {path.relative_to(root).as_posix(): path.read_bytes() for path in written}


def _store(files: dict[str, bytes], folder: Path) -> None:
    """Write what a worker of a cluster has sent."""
    for name, content in files.items():
        with replacing(folder / name) as temporary:
            temporary.write_bytes(content)

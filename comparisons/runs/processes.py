"""Work in child processes: a crash of a native library ends only the process that it is in.

`Children` is the parent's side: it sends requests, enforces time limits, replaces children that die
and reports why.  `run` has requests carried out by children of this process, or of the workers of
a cluster: one that dies or hangs is replaced, and the others go on.

The worker's side is JSON lines on standard input and output.  A worker is a
module that calls `serve`, or `private_stdout` once and `carry_out` for each request.
Each line of its standard input is a JSON object, a request; each line of its standard output
is a message about it:

    {"say": text}          any number of times, what is being done
    {"show": text}         any number of times, pictures of it as `so_far` writes them
    {"done": true}         what was asked for is where it was to be put
    {"failed": text}       it could not be made, and why
    {"invalid": text}      the same, because a scene, or a file that it names, is invalid
    {"unavailable": text}  nothing can be made here, and why
"""

import contextlib
import faulthandler
import json
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from collections import Counter
from collections.abc import Callable, Generator, Hashable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Generic, Protocol, TextIO, TypeVar

from pydantic import BaseModel

from comparisons.runs.elsewhere import check_sources
from comparisons.runs.provenance import everything_fingerprint
from reference_rt.util.errors import ReferenceRtError, ReferenceUnavailableError, SceneError
from reference_rt.util.files import replacing, temporary_folder
from reference_rt.util.processes import tied
from reference_rt.util.workers import Threads, Workers, run_all


def private_stdout() -> TextIO:
    """Standard output for this caller alone: from now on whatever else prints, in Python or not,
    goes to standard error."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    return answers


def send(answers: TextIO, **message: Any) -> None:
    """Write one line of the protocol."""
    print(json.dumps(message), file=answers, flush=True)


def carry_out(task: Callable[[], None], answers: TextIO) -> None:
    """Run the task, and send how it ended."""
    try:
        task()
    except BrokenPipeError:  # nobody listens any more
        raise
    except ReferenceUnavailableError as error:
        send(answers, unavailable=str(error))
    except SceneError as error:
        send(answers, invalid=str(error))
    except ReferenceRtError as error:
        send(answers, failed=str(error))
    except (Exception, SystemExit) as error:
        traceback.print_exc()
        send(answers, failed=f"{type(error).__name__}: {' '.join(str(error).split())}")
    else:
        send(answers, done=True)


M = TypeVar("M", bound=BaseModel)


def serve(kind: type[M], task: Callable[[M], None]) -> None:
    """Carry out requests of this kind until standard input ends."""
    faulthandler.enable()
    answers = private_stdout()
    for line in sys.stdin:
        request = kind.model_validate_json(line)
        carry_out(lambda request=request: task(request), answers)  # type: ignore[misc]


MOST_CASES = 40
"""A child is replaced after so many: what libraries keep of each scene adds up, and a start costs
no more than a small case."""

_QUOTED = 200
"""Characters of a process's last message that a failure quotes."""

_MOST_LOG = 1 << 20
"""Bytes of a case's log that are kept."""

_PATIENCE = 5.0
"""Seconds in which a process that has closed its pipe should have ended."""


@dataclass(frozen=True)
class Ended:
    """How a request ended.  failure: why there is no result, None if there is one;  log: what its
    process wrote to standard error meanwhile;  wall: seconds;  invalid: whether the failure is that
    a scene, or a file that it names, is invalid."""

    failure: str | None
    log: str
    wall: float
    invalid: bool


class Children:
    """The child processes of this one, for its threads: each request takes one that is idle, or a
    new one."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._idle: list[_Child] = []
        self._busy: set[_Child] = set()
        self._closed = False

    def begin(self, module: tuple[str, ...]) -> None:
        """Start a child that imports what it needs while this process prepares the first request.

        module: see `run`.
        """
        with self._lock:
            self._idle.append(_Child(module, ""))

    def carry_out(
        self,
        module: tuple[str, ...],
        folder: str,
        request: str,
        seconds: float,
        say: Callable[[str], None],
    ) -> Ended:
        """Have a child carry out a request, a line of JSON.

        module: see `run`; or a command, which begins with the absolute path of a program that
        keeps to the protocol;  folder: where the child starts, if there is such a folder;
        seconds: its time limit;  say: called with what is being done for it, "" when it begins;
        with `Shown` for its pictures so far.
        Raises ReferenceUnavailableError.
        """
        child = self._take(module, folder)
        try:
            say("")
            return child.carry_out(request, seconds, say)
        finally:
            with self._lock:
                self._busy.remove(child)
                fit = child.is_fit() and not self._closed
                if fit:
                    self._idle.append(child)
            if not fit:
                child.close()

    def close(self) -> None:
        """End all of them; requests that are being carried out fail."""
        with self._lock:
            self._closed = True
            idle, self._idle = self._idle, []
            for child in self._busy:
                child.end()
        for child in idle:
            child.close()

    def _take(self, module: tuple[str, ...], folder: str) -> "_Child":
        others = []
        with self._lock:
            if self._closed:
                raise CancelledError
            same = [c for c in self._idle if c.made_by == (module, folder) and c.is_fit()]
            if not same:  # no more processes than threads
                others, self._idle = self._idle, []
            child = same[0] if same else _Child(module, folder)
            if same:
                self._idle.remove(child)
            self._busy.add(child)
        for other in others:
            other.close()
        return child


class Shown(str):
    """What is being done, as pictures that stand above a terminal's bar."""


class _Child:
    """A process that carries out one request at a time."""

    def __init__(self, module: tuple[str, ...], folder: str) -> None:
        self.made_by = (module, folder)
        self._inbox: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 (closed by `close`)
        # A session of its own: Ctrl-C is for the parent, which then ends its children.
        try:
            self._process = subprocess.Popen(
                list(module) if Path(module[0]).is_absolute() else [sys.executable, "-m", *module],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._log,
                start_new_session=True,
                cwd=folder if folder and Path(folder).is_dir() else None,
                **tied(),
            )
        except BaseException:  # there is no such program, or no memory for it
            self._log.close()
            raise
        self._cases = 0
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def carry_out(self, request: str, seconds: float, say: Callable[[str], None]) -> Ended:
        """See `Children.carry_out`."""
        start, deadline = time.perf_counter(), time.monotonic() + seconds
        # What it says before its first request is part of that: it may have failed to start.
        log_start = os.fstat(self._log.fileno()).st_size if self._cases else 0
        self._cases += 1
        assert self._process.stdin is not None
        # That it is dead already shows at the end of its output.
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.write(request.encode() + b"\n")
            self._process.stdin.flush()
        failure: str | None
        while True:
            message = self._next(deadline)
            if message is not None and "say" in message:
                say(str(message["say"]))
                continue
            if message is not None and "show" in message:
                say(Shown(message["show"]))
                continue
            break
        if message is None:
            self.end()
            failure = f"took longer than {seconds:g} s"
        elif "unavailable" in message:
            raise ReferenceUnavailableError(str(message["unavailable"]))
        elif message:
            failure = message.get("invalid", message.get("failed"))
        else:
            failure = self._cause_of_death(log_start)
        invalid = message is not None and "invalid" in message
        return Ended(failure, self._log_from(log_start), time.perf_counter() - start, invalid)

    def is_fit(self) -> bool:
        """Whether it can carry out another request."""
        return self._process.poll() is None and self._cases < MOST_CASES

    def end(self) -> None:
        """End the process and those that it started."""
        if self._process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    def close(self) -> None:
        """The same, and release its pipes and its log."""
        self.end()
        if self._process.stdin is not None:
            with contextlib.suppress(BrokenPipeError):
                self._process.stdin.close()
        self._listener.join()
        self._log.close()

    def _next(self, deadline: float) -> dict[str, Any] | None:
        """Its next message: {} if it has died, None if the time is up."""
        try:
            line = self._inbox.get(timeout=max(deadline - time.monotonic(), 0.0))
        except queue.Empty:
            return None
        return json.loads(line) if line else {}

    def _cause_of_death(self, log_start: int) -> str:
        """Why its output ended."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_PATIENCE)
        self.end()
        code = self._process.returncode
        if code < 0:
            cause = f"the process died by signal {-code} ({_signal_name(-code)})"
            if code == -signal.SIGKILL:
                cause += ", perhaps for lack of memory"
        else:
            cause = f"the process ended with code {code} in the midst of the case"
        said = self._log_from(log_start).partition("Fatal Python error")[0].split("\n")
        last = next((line.strip() for line in reversed(said) if line.strip()), "")
        return f"{cause}; it said: {last[:_QUOTED]}" if last else cause

    def _listen(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for line in lines:
                self._inbox.put(line)
        self._inbox.put(b"")

    def _log_from(self, start: int) -> str:
        """What it has written to standard error since then."""
        return os.pread(self._log.fileno(), _MOST_LOG, start).decode(errors="replace")


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return "unknown"


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
    children: Children | None = None,
) -> Generator[Outcome[R], None, None]:
    """Have requests carried out, and yield outcomes as they come.

    workers: `Threads` of this process, each with a child process, or those of a cluster, whose
    workers have child processes of their own and send back the files that these write;  seconds:
    time limit of a request;  progress: called with a request and what is being done for it, ""
    when it begins; steps are not reported by clusters;  module: of a worker that keeps to the
    protocol, and options of its command line;  kin: requests of equal kin need the same kernels: on
    this machine they follow each other, see `_Turns`;  children: of this process, if some were
    begun already.  Closing the iterator ends the processes of this machine.  Raises
    ReferenceUnavailableError where none can be carried out; WorkersError.
    """
    if isinstance(workers, Threads):
        some = children or Children()
        with closing(_run_here(requests, workers, seconds, progress, module, kin, some)) as found:
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
    children: Children,
) -> Generator[Outcome[R], None, None]:
    turns = _Turns(requests, kin)
    steps: queue.SimpleQueue[tuple[R, str]] = queue.SimpleQueue()

    def watch() -> None:
        while not steps.empty():
            progress(*steps.get())

    with closing(children):

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

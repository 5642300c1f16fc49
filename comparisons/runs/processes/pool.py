"""Worker processes that carry out requests: one that dies or hangs is replaced, and the others go
on."""

import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from reference_rt.util.child_processes import tied
from reference_rt.util.errors import ReferenceUnavailableError

MOST_CASES = 40
"""A worker is replaced after so many: what libraries keep of each scene adds up, and a start costs
no more than a small case."""

_QUOTED = 200
"""Characters of a process's last message that a failure quotes."""

_MOST_LOG = 1 << 20
"""Bytes of a case's log that are kept."""

_PATIENCE = 5.0
"""Seconds in which a process that has closed its pipe should have ended."""


class Request(Protocol):
    """What is asked for, as one line of JSON."""

    def model_dump_json(self) -> str: ...


R = TypeVar("R", bound=Request)


@dataclass(frozen=True)
class Outcome(Generic[R]):
    """How a request ended.  failure: why there is no result, None if there is one;  log: what its
    process wrote to standard error meanwhile;  wall: seconds;  invalid: whether the failure is that
    a scene, or a file that it names, is invalid."""

    request: R
    failure: str | None
    log: str
    wall: float
    invalid: bool = False


def run(
    requests: Sequence[R],
    workers: int,
    seconds: float,
    progress: Callable[[R, str], None],
    module: Sequence[str],
) -> Generator[Outcome[R], None, None]:
    """Have requests carried out by as many processes at once, and yield outcomes as they come.

    seconds: time limit of a request;  progress: called with a request and what is being done for
    it, "" when it begins;  module: of a worker that keeps to `protocol`, and options of its command
    line.  Closing the iterator ends the processes.  Raises ReferenceUnavailableError where none can
    be carried out.
    """
    command = [sys.executable, "-m", *module]
    left = list(reversed(requests))
    inbox: queue.Queue[tuple[_Worker[R], bytes]] = queue.Queue()
    busy: list[_Worker[R]] = []
    with contextlib.ExitStack() as cleanup:

        def employ() -> None:
            worker = _Worker[R](command, inbox)
            cleanup.callback(worker.close)
            busy.append(worker)
            give(worker)

        def give(worker: _Worker[R]) -> None:
            request = left.pop()
            worker.begin(request, time.monotonic() + seconds)
            progress(request, "")

        for _ in range(min(workers, len(left))):
            employ()
        while busy:
            worker, message = _next(inbox, busy)
            if worker not in busy:
                continue  # sent before it was killed
            failure: str | None
            invalid = message is not None and "invalid" in message
            if message is None:
                worker.end()
                failure = f"took longer than {seconds:g} s"
            elif "say" in message:
                progress(worker.request, str(message["say"]))
                continue
            elif "unavailable" in message:
                raise ReferenceUnavailableError(str(message["unavailable"]))
            elif message:
                failure = message.get("invalid", message.get("failed"))
            else:
                failure = worker.cause_of_death()
            yield worker.outcome(failure, invalid)
            if left and worker.is_fit():
                give(worker)
            else:
                worker.close()
                busy.remove(worker)
                if left:
                    employ()


def _next(
    inbox: "queue.Queue[tuple[_Worker[R], bytes]]", busy: "list[_Worker[R]]"
) -> "tuple[_Worker[R], dict[str, Any] | None]":
    """A worker and its message: {} if it has died, None if its time is up."""
    late = min(busy, key=lambda worker: worker.deadline)
    try:
        worker, line = inbox.get(timeout=max(late.deadline - time.monotonic(), 0.0))
    except queue.Empty:
        return late, None
    return worker, json.loads(line) if line else {}


class _Worker(Generic[R]):
    """A process that runs one case at a time."""

    def __init__(
        self, command: Sequence[str], inbox: "queue.Queue[tuple[_Worker[R], bytes]]"
    ) -> None:
        self._inbox = inbox
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 (closed by `end`)
        # A session of its own: Ctrl-C is for the pool, which then ends the workers.
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            start_new_session=True,
            **tied(),
        )
        self._cases = 0
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def begin(self, request: R, deadline: float) -> None:
        """Ask for a case that must end before `deadline`, as time.monotonic counts."""
        self.request, self.deadline = request, deadline
        self._start, self._log_start = time.perf_counter(), os.fstat(self._log.fileno()).st_size
        self._cases += 1
        assert self._process.stdin is not None
        # That it is dead already shows at the end of its output.
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.write(request.model_dump_json().encode() + b"\n")
            self._process.stdin.flush()

    def outcome(self, failure: str | None, invalid: bool) -> Outcome[R]:
        """How the case ended."""
        wall = time.perf_counter() - self._start
        return Outcome(self.request, failure, self._log_of_case(), wall, invalid)

    def is_fit(self) -> bool:
        """Whether it can run another case."""
        return self._process.poll() is None and self._cases < MOST_CASES

    def cause_of_death(self) -> str:
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
        said = self._log_of_case().partition("Fatal Python error")[0].split("\n")
        last = next((line.strip() for line in reversed(said) if line.strip()), "")
        return f"{cause}; it said: {last[:_QUOTED]}" if last else cause

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

    def _listen(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for line in lines:
                self._inbox.put((self, line))
        self._inbox.put((self, b""))

    def _log_of_case(self) -> str:
        """What it wrote to standard error since the case began."""
        text = os.pread(self._log.fileno(), _MOST_LOG, self._log_start)
        return text.decode(errors="replace")


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return "unknown"

"""Child processes that carry out one request after another."""

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
from collections.abc import Callable
from concurrent.futures import CancelledError
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reference_rt.util.errors import ReferenceUnavailableError
from reference_rt.util.processes import tied

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

    def carry_out(
        self,
        module: tuple[str, ...],
        folder: str,
        request: str,
        seconds: float,
        say: Callable[[str], None],
    ) -> Ended:
        """Have a child carry out a request, a line of JSON.

        module: see `pool.run`;  folder: where the child starts, if there is such a folder;
        seconds: its time limit;  say: called with what is being done for it, "" when it begins.
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


class _Child:
    """A process that carries out one request at a time."""

    def __init__(self, module: tuple[str, ...], folder: str) -> None:
        self.made_by = (module, folder)
        self._inbox: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 (closed by `close`)
        # A session of its own: Ctrl-C is for the parent, which then ends its children.
        self._process = subprocess.Popen(
            [sys.executable, "-m", *module],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            start_new_session=True,
            cwd=folder if folder and Path(folder).is_dir() else None,
            **tied(),
        )
        self._cases = 0
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def carry_out(self, request: str, seconds: float, say: Callable[[str], None]) -> Ended:
        """See `Children.carry_out`."""
        start, deadline = time.perf_counter(), time.monotonic() + seconds
        log_start = os.fstat(self._log.fileno()).st_size
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

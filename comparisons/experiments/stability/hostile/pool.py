"""Hostile cases in processes of their own: one that dies is replaced, and the others go on.

A process serves one sweep point after another: to start one takes as long as fifty cases.
"""

import atexit
import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from reference_rt.util.child_processes import tied

SECONDS = 5.0
"""A case that computes for longer hangs."""

PLAIN_SECONDS = 120.0
"""In plain Python: 8 x 8 pixels take it some 30 times as long as compiled code, deep paths more."""


class Answer(NamedTuple):
    """What came of a case.

    exit: the code that the command would return, None where its process died;  said: on standard
    error, or why it died;  nonfinite: pixels that the file would show as not finite;  rendered:
    whether there was a picture;  signature: the combination of kernels.
    """

    exit: int | None
    said: str
    nonfinite: int = 0
    rendered: bool = False
    signature: str | None = None


def answers(
    scenes: Sequence[Path],
    *,
    plain: bool = False,
    signatures: Sequence[str | None] | None = None,
    module: str = "comparisons.experiments.stability.hostile.worker",
) -> Iterator[Answer]:
    """Of each scene in turn.

    plain: by plain Python, which compiles nothing;  signatures: with others, scenes are built but
    not rendered.
    """
    wanted = signatures or [None] * len(scenes)
    for scene, signature in zip(scenes, wanted, strict=True):
        worker = _workers.get((module, plain))
        if worker is None:
            worker = _workers[module, plain] = _Worker(module, plain)
        answer = worker.run({"scene": str(scene), "signature": signature})
        if answer.exit is None:
            _workers.pop((module, plain)).close()
        yield answer


_workers: dict[tuple[str, bool], "_Worker"] = {}
"""Those that run, by module and whether they compile nothing."""


@atexit.register
def close() -> None:
    """Ends them all."""
    while _workers:
        _workers.popitem()[1].close()


class _Worker:
    def __init__(self, module: str, plain: bool) -> None:
        environment = os.environ | ({"NUMBA_DISABLE_JIT": "1"} if plain else {})
        self.process = subprocess.Popen(
            [sys.executable, "-m", module],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=environment,
            **tied(),
        )
        self.seconds = PLAIN_SECONDS if plain else SECONDS
        self._send({"seconds": self.seconds})

    def _send(self, message: dict[str, Any]) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps(message) + "\n")
        self.process.stdin.flush()

    def run(self, case: dict[str, Any]) -> Answer:
        assert self.process.stdout is not None
        try:
            self._send(case)
            line = self.process.stdout.readline()
        except BrokenPipeError:
            line = ""
        if not line:
            return Answer(None, self._death())
        return Answer(**json.loads(line))

    def _death(self) -> str:
        code = self.process.wait()
        if code == -signal.SIGPROF:
            return f"hangs: computed for {self.seconds:g} s"
        if code == -signal.SIGALRM:
            return "hangs: waits"
        name = signal.Signals(-code).name if code < 0 else str(code)
        return f"crashes: the process ended with {name}"

    def close(self) -> None:
        """Ends the process."""
        for stream in (self.process.stdin, self.process.stdout):
            if stream is not None:
                with contextlib.suppress(BrokenPipeError):
                    stream.close()
        self.process.wait()

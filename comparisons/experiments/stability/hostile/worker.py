"""A process that renders hostile scenes, one after another, as `reference-rt render` does.

Its first line of standard input is the settings, each other one a case: {"scene": path,
"signature": ...}; it answers each with one line: what came of it.  A case that takes longer than it
may ends the process: by SIGPROF where it computes, by SIGALRM where it waits."""

import atexit
import contextlib
import hashlib
import io
import json
import os
import resource
import signal
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple, TextIO

import numba
import numpy as np
import typer

from comparisons.experiments.stability.harness.outcomes import Outcome, outcome
from reference_rt.cli.guarded import guarded
from reference_rt.cli.options import adjusted
from reference_rt.integrators import RayCast
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering import image
from reference_rt.rendering.picture import Picture, provenance
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables
from reference_rt.util.errors import ImageError
from reference_rt.util.processes import tied

# Hostile cases in processes of their own: one that dies is replaced, and the others go on.
#
# A process serves one sweep point after another: to start one takes as long as fifty cases.


SECONDS = 5.0
"""A case that computes for longer hangs."""

PLAIN_SECONDS = 120.0
"""In plain Python: 8 x 8 pixels take it some 30 times as long as compiled code, deep paths more."""


MODULE = "comparisons.experiments.stability.hostile.worker"

By = Literal["ours", "plain", "mitsuba"]


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
    by: By = "ours",
    signatures: Sequence[str | None] | None = None,
) -> Iterator[Answer]:
    """Of each scene in turn.

    by: "plain": plain Python, which compiles nothing;  signatures: with others, scenes are built
    but not rendered.
    """
    wanted = signatures or [None] * len(scenes)
    for scene, signature in zip(scenes, wanted, strict=True):
        worker = _workers.get(by)
        if worker is None:
            worker = _workers[by] = _Worker(by)
        answer = worker.run({"scene": str(scene), "signature": signature})
        if answer.exit is None:
            _workers.pop(by).close()
        yield answer


_workers: dict[By, "_Worker"] = {}
"""Those that run."""


@atexit.register
def close() -> None:
    """Ends them all."""
    while _workers:
        _workers.popitem()[1].close()


class _Worker:
    def __init__(self, by: By) -> None:
        environment = os.environ | ({"NUMBA_DISABLE_JIT": "1"} if by == "plain" else {})
        self.process = subprocess.Popen(
            [sys.executable, "-m", MODULE, by],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=environment,
            **tied(),
        )
        self.seconds = PLAIN_SECONDS if by == "plain" else SECONDS
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


SIZE, SAMPLES = "8x8", 1

MOST_MEMORY = 12 << 30
"""Bytes of address space: an allocation beyond raises instead of taking the machine's memory."""

WAITING = 40.0
"""Times as long a case may take when it does not compute, on a machine that is busy."""


def serve(outcome: Callable[[Path, str | None, "Clock"], dict[str, Any]]) -> None:
    """Answers cases until there are none."""
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    warnings.simplefilter("ignore")
    answers = os.fdopen(os.dup(1), "w")
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)  # what libraries print is no answer
    seconds = float(json.loads(sys.stdin.readline())["seconds"])
    clock = Clock(seconds)
    for line in sys.stdin:
        case = json.loads(line)
        answer = outcome(Path(case["scene"]), case.get("signature"), clock)
        _say(answers, answer)


def _say(answers: TextIO, answer: dict[str, Any]) -> None:
    answers.write(json.dumps(answer) + "\n")
    answers.flush()


class Clock:
    """Ends the process when a case takes too long; compiling does not count."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds

    def start(self) -> None:
        signal.setitimer(signal.ITIMER_PROF, self.seconds)
        signal.setitimer(signal.ITIMER_REAL, self.seconds * WAITING)

    def stop(self) -> None:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def _outcome(path: Path, signature: str | None, clock: Clock) -> dict[str, Any]:
    """exit: the code that the command would return;  said: what it would write to standard error;
    nonfinite: the pixels that files would show as not finite;  signature: of the kernels;
    rendered: whether it came to a picture."""
    found: dict[str, Any] = {"exit": 0, "said": "", "nonfinite": 0, "rendered": False}
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            clock.start()
            _render(path, signature, found, clock)
    except typer.Exit as stopped:
        found["exit"] = stopped.exit_code
    finally:
        clock.stop()
    found["said"] = said.getvalue().strip()
    return found


@guarded
def _render(path: Path, wanted: str | None, found: dict[str, Any], clock: Clock) -> None:
    """As the command of the same name, without a file.  Where `wanted` is another combination of
    kernels, stops before they are compiled."""
    scene = adjusted(Scene.load(path), SAMPLES, SIZE)
    tables = build_tables(scene)
    found["signature"] = signature = signature_of(scene, tables)
    if wanted is not None and signature != wanted:
        return

    def progress(what: str, fraction: float) -> None:
        if what == "compile":
            (clock.stop if fraction == 0.0 else clock.start)()

    provenance(scene)
    picture = render(scene, threads=1, tables=tables, progress=progress)
    found["rendered"] = True
    found["nonfinite"] = count_nonfinite(picture)
    bad = picture.nonfinite_pixels
    if len(bad) > 0:
        raise ImageError(f"{path}: {len(bad)} pixels are not finite; expected light that is")


def count_nonfinite(picture: Picture) -> int:
    """Pixels of which the file would hold a number that is not finite; of the distances, which are
    infinite for a miss, NaN alone."""
    bad = np.zeros(picture.colour.shape[:2], bool)
    with np.errstate(over="ignore"):
        for name, plane in image.channels(picture.layers).items():
            values = plane.astype(np.float32)
            far = name in ("distance.Z", "depth.Z")
            bad |= np.isnan(values) if far else ~np.isfinite(values)
    return int(bad.sum())


def signature_of(scene: Scene, tables: SceneTables) -> str:
    """Scenes of one signature are rendered by the same compiled kernels."""
    film = scene.film
    parts: list[Any] = [
        tables.parts,
        scene.camera.setup(film.width, film.height),
        film.filter.setup(),
    ]
    if not isinstance(scene.integrator, RayCast):
        parts += [scene.integrator.setup(), scene.resolved_sampler.setup()]
    names = f"{scene.integrator.type} {film.layers} {numba.typeof(tuple(parts))}"
    return hashlib.sha256(names.encode()).hexdigest()


# ---- Mitsuba with hostile scenes -----------------------------------------------------------------


def judged_of_mitsuba(scenes: Sequence[Path]) -> Outcome:
    """Of the scenes that ours accepts and that have a twin: a process that ends, a hang and pixels
    that are not finite are failures; an exception is a defined error."""
    rendered = [
        (scene, answer)
        for scene, answer in zip(scenes, answers(scenes, "mitsuba"), strict=True)
        if answer.exit != 0 or answer.rendered
    ]
    wrong = np.array([answer.exit is None or answer.nonfinite > 0 for _, answer in rendered], bool)

    def came(k: int) -> str:
        answer = rendered[k][1]
        return answer.said or f"{answer.nonfinite} pixels not finite"

    return outcome(wrong, {"scene": lambda k: rendered[k][0].read_text()[:2000], "came": came})


def _mitsubas(path: Path, _: str | None, clock: Any) -> dict[str, Any]:
    from comparisons import translator
    from comparisons.mitsuba.context import UntranslatableError
    from comparisons.mitsuba.scene import picture
    from reference_rt.cli.options import adjusted
    from reference_rt.rendering.scene import Scene
    from reference_rt.util.errors import ReferenceRtError

    found: dict[str, Any] = {"exit": 0, "said": "", "nonfinite": 0, "rendered": False}
    try:
        scene = adjusted(Scene.load(path), SAMPLES, SIZE)
        assert scene.tables is not None  # built now, so that its errors are raised here
    except ReferenceRtError:
        return found
    with contextlib.redirect_stderr(io.StringIO()):
        try:
            counterpart = translator.load(
                scene
            )  # which takes seconds for curved shapes, for our own part
            if counterpart.no_pictures_reason:
                return found
            clock.start()
            pixels = picture(counterpart.mi_scene, SAMPLES, 0)
        except UntranslatableError:
            return found
        except Exception as error:  # what Mitsuba refuses, it refuses by various classes
            return found | {"exit": 3, "said": str(error)[:300], "rendered": True}
        finally:
            clock.stop()
    return found | {"nonfinite": int((~np.isfinite(pixels).all(axis=-1)).sum()), "rendered": True}


if __name__ == "__main__":
    if "mitsuba" in sys.argv:
        from comparisons.mitsuba.backend import scalar

        with scalar():  # once: to change the variant takes as long as a case
            serve(_mitsubas)
    else:
        serve(_outcome)

"""Mitsuba with hostile scenes, in a process of its own: run as a module it is that process."""

import contextlib
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.experiments.stability.harness.family import EXAMPLES, Outcome
from comparisons.experiments.stability.hostile.pool import answers
from comparisons.experiments.stability.hostile.worker import SAMPLES, SIZE, serve


def judged(scenes: Sequence[Path]) -> Outcome:
    """Of the scenes that ours accepts and that have a twin: a process that ends, a hang and pixels
    that are not finite are failures; an exception is a defined error."""
    cases, failures, examples = 0, 0, []
    for scene, answer in zip(scenes, answers(scenes, module=__name__), strict=True):
        if answer.exit == 0 and not answer.rendered:
            continue
        cases += 1
        if answer.exit is None or answer.nonfinite:
            failures += 1
            came = answer.said or f"{answer.nonfinite} pixels not finite"
            examples.append({"scene": scene.read_text()[:2000], "came": came})
    return Outcome(cases, failures, None, 0, tuple(examples[:EXAMPLES]))


def _outcome(path: Path, _: str | None, clock: Any) -> dict[str, Any]:
    from comparisons.mitsuba import translate
    from comparisons.mitsuba.scene import picture
    from comparisons.mitsuba.translate.errors import UntranslatableError
    from reference_rt.cli.main import adjusted
    from reference_rt.rendering.scene import Scene
    from reference_rt.util.errors import ReferenceRtError

    found: dict[str, Any] = {"exit": 0, "said": "", "nonfinite": 0, "rendered": False}
    try:
        scene = adjusted(Scene.load(path), SAMPLES, SIZE)
        assert scene.tables is not None  # made now, so that what is wrong with it is told
    except ReferenceRtError:
        return found
    with contextlib.redirect_stderr(io.StringIO()):
        try:
            twin = translate.load(scene)  # which takes seconds for curved shapes, for our own part
            if twin.lacking:
                return found
            clock.start()
            pixels = picture(twin.mi_scene, SAMPLES, 0)
        except UntranslatableError:
            return found
        except Exception as error:  # what Mitsuba refuses, it refuses by various classes
            return found | {"exit": 3, "said": str(error)[:300], "rendered": True}
        finally:
            clock.stop()
    return found | {"nonfinite": int((~np.isfinite(pixels).all(axis=-1)).sum()), "rendered": True}


if __name__ == "__main__":
    from comparisons.mitsuba.backend import scalar

    with scalar():  # once: to change the variant takes as long as a case
        serve(_outcome)

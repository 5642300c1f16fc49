"""Mitsuba with hostile scenes, in a process of its own: run as a module it is that process."""

import contextlib
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.experiments.stability.harness.core import Outcome, outcome
from comparisons.experiments.stability.hostile.worker import SAMPLES, SIZE, answers, serve


def judged(scenes: Sequence[Path]) -> Outcome:
    """Of the scenes that ours accepts and that have a twin: a process that ends, a hang and pixels
    that are not finite are failures; an exception is a defined error."""
    rendered = [
        (scene, answer)
        for scene, answer in zip(scenes, answers(scenes, module=__name__), strict=True)
        if answer.exit != 0 or answer.rendered
    ]
    wrong = np.array([answer.exit is None or answer.nonfinite > 0 for _, answer in rendered], bool)

    def came(k: int) -> str:
        answer = rendered[k][1]
        return answer.said or f"{answer.nonfinite} pixels not finite"

    return outcome(wrong, {"scene": lambda k: rendered[k][0].read_text()[:2000], "came": came})


def _outcome(path: Path, _: str | None, clock: Any) -> dict[str, Any]:
    from comparisons.mitsuba import translate
    from comparisons.mitsuba.scene import picture
    from comparisons.mitsuba.translate.textures import UntranslatableError
    from reference_rt.cli.adjusted import adjusted
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
            counterpart = translate.load(
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
    from comparisons.mitsuba.backend import scalar

    with scalar():  # once: to change the variant takes as long as a case
        serve(_outcome)

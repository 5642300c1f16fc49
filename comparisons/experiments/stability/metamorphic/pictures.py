"""Pictures of F9's failures, 192 pixels wide."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

import reference_rt as rt
from comparisons.experiments.relations import Motion, differ, moved
from comparisons.experiments.stability.harness import scenes
from comparisons.experiments.stability.harness.outcomes import OURS, FloatArray
from comparisons.experiments.stability.harness.shots import Shot
from comparisons.experiments.stability.metamorphic import light, rays
from comparisons.geometry.affine import unit_rows
from comparisons.geometry.exact.dyadic import BoolArray
from comparisons.geometry.frame import round32
from reference_rt.util.files import temporary_folder

WIDTH, HEIGHT = 192, 144

SPP = 16

WRONG = np.array([0.85, 0.10, 0.05])


def shoot_light(motion: Callable[[float], Motion], contestant: str, x: float) -> Shot:
    """The path-traced scene, transformed."""
    with temporary_folder() as folder:
        scene = scenes.path(folder).changed(
            film=rt.Film(width=WIDTH, height=HEIGHT), sampler=rt.Sobol(spp=SPP, seed=3)
        )
        first, found = (light.colours(contestant, s) for s in (scene, moved(scene, motion(x))))
    visible = np.abs(found - first).max(axis=-1) > 0.1 * first.max(axis=-1) + 0.02
    visible |= ~np.isfinite(found).all(axis=-1)
    said = f"{contestant} at {x:g}: {_percent(visible)} of the pixels visibly other than at 1"
    return Shot(_bytes(np.clip(np.nan_to_num(found), 0.0, 1.0) ** (1.0 / 2.2)), said)


def shoot_rays(motion: Callable[[float], Motion], contestant: str, x: float) -> Shot:
    """What the pixels' rays hit in the scene of things, transformed; red where it is not what they
    hit before."""
    with temporary_folder() as folder:
        scene = scenes.things(folder)
        o = np.tile(scene.camera.eye, (WIDTH * HEIGHT, 1))
        d = round32(_directions(scene))
        pixels = rays.Rays(o, d, np.ones(len(o), bool))
        answers = []
        for one in (Motion(), motion(x)):
            other = moved(scene, one)
            o, d = rays.through(one, pixels)
            if contestant == OURS:
                answers.append(rays.ours(rt.build_tables(other), o, d))
            else:
                answers.append(rays.mitsubas(other, o, d))
    first, found = answers
    wrong = differ(first.identities, found.identities)
    # A colour a face: the golden ratio spreads hues.
    face = first.identities @ (7, 5, 3, 1)
    hue = np.mod(face[:, None] * 0.618 + np.array([0.0, 0.33, 0.67]), 1.0)
    shown = np.where(first.identities[:, :1] < 0, 0.95, 0.35 + 0.5 * hue)
    shown[wrong] = WRONG
    said = f"{contestant} at {x:g}: {_percent(wrong)} of the rays hit something else (red)"
    return Shot(_bytes(shown.reshape(HEIGHT, WIDTH, 3)), said)


def _directions(scene: rt.Scene) -> FloatArray:
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    view = scene.camera.setup(WIDTH, HEIGHT)
    across, down = x.reshape(-1, 1) / WIDTH, y.reshape(-1, 1) / HEIGHT
    return unit_rows(
        np.array(view.corner) + np.array(view.right) * across + np.array(view.down) * down
    )


def _percent(some: BoolArray) -> str:
    return f"{100.0 * np.mean(some):.2g} %"


def _bytes(values: FloatArray) -> npt.NDArray[np.uint8]:
    return np.rint(255.0 * values).astype(np.uint8)

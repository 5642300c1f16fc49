"""How a whole scene is transformed, and the transforms of F9."""

from collections.abc import Sequence
from itertools import permutations, product
from typing import Any, NamedTuple

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.core import FloatArray
from comparisons.experiments.stability.harness.scenes import SIZE
from comparisons.experiments.stability.harness.steps import matrix, vector
from reference_rt.core import transform
from reference_rt.shapes.shape import Shape


class Motion(NamedTuple):
    """p -> factor turn p + offset.  turn: (3, 3), orthogonal to within rounding."""

    factor: float = 1.0
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: FloatArray = np.eye(3)

    @property
    def affine(self) -> transform.Affine:
        return np.column_stack([self.factor * self.turn, self.offset])

    def point(self, p: Sequence[float]) -> tuple[float, float, float]:
        return vector(transform.apply_points(self.affine, np.array([p], np.float64))[0])

    def vector(self, v: Sequence[float]) -> tuple[float, float, float]:
        """Turned alone."""
        turn = np.column_stack([self.turn, np.zeros(3)])
        return vector(transform.apply_points(turn, np.array([v], np.float64))[0])

    @property
    def step(self) -> transform.Matrix:
        return matrix(self.factor * self.turn, np.array(self.offset))[0]


def moved(scene: rt.Scene, motion: Motion) -> rt.Scene:
    """The scene, all of it: shapes, camera and lights; intensities such that it looks the same."""
    camera = scene.camera
    assert isinstance(camera, rt.Perspective)
    camera = camera.model_copy(
        update={
            "eye": motion.point(camera.eye),
            "target": motion.point(camera.target),
            "up": motion.vector(camera.up),
        }
    )
    return scene.changed(
        camera=camera,
        shapes=tuple(_moved_shape(shape, motion) for shape in scene.shapes),
        lights=tuple(_moved_light(light, motion) for light in scene.lights),
    )


def _moved_shape(shape: Any, motion: Motion) -> Shape:
    found: Shape = shape.model_copy(update={"transform": (*shape.transform, motion.step)})
    return found


def _moved_light(light: Any, motion: Motion) -> Any:
    brighter = motion.factor * motion.factor
    if isinstance(light, rt.Point | rt.Spot):
        update: dict[str, Any] = {"intensity": tuple(brighter * x for x in light.intensity)}
        places = ("position",) if isinstance(light, rt.Point) else ("origin", "target")
        update |= {name: motion.point(getattr(light, name)) for name in places}
        return light.model_copy(update=update)
    if isinstance(light, rt.Directional):
        return light.model_copy(update={"direction": motion.vector(light.direction)})
    return light  # the same from everywhere


# ---- of a series --------------------------------------------------------------------------------


def offset(x: float) -> Motion:
    far = x * SIZE
    return Motion(offset=(far, -0.5 * far, 0.25 * far))


def grown(x: float) -> Motion:
    return Motion(x)


def shrunk(x: float) -> Motion:
    return Motion(1.0 / x)


TURNINGS = MIRRORS, EXCHANGES, TURNS, BOTH_OF_THESE = 0.0, 1.0, 2.0, 3.0


def turns_of(rng: np.random.Generator, x: float) -> list[FloatArray]:
    if x == MIRRORS:
        return [np.diag(signs) for signs in product((1.0, -1.0), repeat=3) if min(signs) < 0.0]
    if x == EXCHANGES:
        return [np.eye(3)[list(order)] for order in permutations(range(3)) if order != (0, 1, 2)]
    mirror = np.diag([1.0, 1.0, -1.0 if x == BOTH_OF_THESE else 1.0])
    # QR of normal numbers: turns that are spread evenly, up to the signs of columns.
    found = [np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(6)]
    return [turn * np.sign(np.linalg.det(turn)) @ mirror for turn in found]

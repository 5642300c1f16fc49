"""Valid scenes that are probably not what their author meant: the warnings of `render` and
`explain`."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from reference_rt.core.transform import Rotate, Transform
from reference_rt.integrators import RayCast, Whitted
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.lights import EnvironmentMap, Spot
from reference_rt.materials import Emissive
from reference_rt.scene.model import SceneModel
from reference_rt.shapes import Shape
from reference_rt.shapes.csg import Solid

_SMALLEST_FOV = 0.1
"""Radians, 5.7 degrees: hardly any scene has a smaller field of view."""

_ROUND = math.pi / 12.0
"""15 degrees: round angles in radians are multiples of it."""

_DIGITS = 6e-4
"""Relative error of such an angle in radians with two decimals, such as 1.57."""


class Mistake(NamedTuple):
    """A warning, and the key path of the scene that it is about."""

    message: str
    path: tuple[str | int, ...]


def likely_mistakes(scene: SceneModel, tables: SceneTables) -> list[Mistake]:
    """Probable mistakes in a scene that is about to be rendered, in the order of its keys."""
    return [*_camera(scene), *_shapes(scene, tables), *_angles(scene), *_darkness(scene, tables)]


def _camera(scene: SceneModel) -> Iterator[Mistake]:
    if scene.is_from_file and "camera" not in scene.model_fields_set:
        yield Mistake(
            "the scene has no camera: it is seen from the origin, along -z, with a fov of 45 "
            "degrees; expected a key 'camera'",
            (),
        )
    fov = getattr(scene.camera, "fov", None)
    if fov is not None and _SMALLEST_FOV <= fov <= math.pi and fov != int(fov):
        yield Mistake(_as_radians("an angle of view", fov), ("camera", "fov"))


def _as_radians(what: str, degrees: float) -> str:
    return (
        f"{what} of {degrees:g} degrees is small; if radians were meant, expected "
        f"{math.degrees(degrees):.4g}"
    )


def _shapes(scene: SceneModel, tables: SceneTables) -> Iterator[Mistake]:
    if not scene.shapes and tables.lights.environment is None and scene.camera.medium is None:
        yield Mistake("the scene has no shapes: the picture is empty; expected a key 'shapes'", ())


def _angles(scene: SceneModel) -> Iterator[Mistake]:
    for i, light in enumerate(scene.lights):
        if isinstance(light, Spot):
            angle = light.cutoff_angle
            if _SMALLEST_FOV <= angle <= math.pi and angle != int(angle):
                yield Mistake(_as_radians("a cutoff angle", angle), ("lights", i, "cutoff_angle"))
    turns = [(abs(degrees), path) for degrees, path in _rotations(scene) if degrees != 0.0]
    if turns and all(_is_round_in_radians(degrees) for degrees, _ in turns):
        degrees, path = turns[0]
        yield Mistake(
            f"all rotations of the scene are round angles in radians, such as {degrees:g}; "
            f"expected degrees, here {math.degrees(degrees):.4g}",
            path,
        )


def _is_round_in_radians(angle: float) -> bool:
    """Of an angle above 0; at most a full turn."""
    if angle > 2.0 * math.pi * (1.0 + _DIGITS):
        return False
    multiple = round(angle / _ROUND)
    is_near = abs(angle - multiple * _ROUND) <= _DIGITS * angle
    return multiple > 0 and is_near and angle != int(angle)


def _rotations(scene: SceneModel) -> Iterator[tuple[float, tuple[str | int, ...]]]:
    """Each rotation of the scene: degrees, and key path."""
    for i, shape in enumerate(scene.shapes):
        yield from _rotations_of(shape, ("shapes", i))
    for name, shapes in scene.groups.items():
        for i, shape in enumerate(shapes):
            yield from _rotations_of(shape, ("groups", name, i))
    for i, light in enumerate(scene.lights):
        if isinstance(light, EnvironmentMap):
            yield from _steps(light.transform, ("lights", i))


def _rotations_of(
    shape: Shape, path: tuple[str | int, ...]
) -> Iterator[tuple[float, tuple[str | int, ...]]]:
    yield from _steps(shape.transform, path)
    if isinstance(shape, Solid):
        for k, operand in enumerate(shape.of):
            yield from _rotations_of(operand, (*path, "of", k))


def _steps(
    transform: Transform, path: tuple[str | int, ...]
) -> Iterator[tuple[float, tuple[str | int, ...]]]:
    for k, step in enumerate(transform):
        if isinstance(step, Rotate):
            yield step.rotate.degrees, (*path, "transform", k, "rotate", "degrees")


def _darkness(scene: SceneModel, tables: SceneTables) -> Iterator[Mistake]:
    """A scene without emission: no light to sample, and none that BSDF-sampled rays could hit."""
    lights, integrator = tables.lights, scene.integrator
    if isinstance(integrator, RayCast) or scene.film.layers or lights.choice is not None:
        return  # layers are of use without light, too
    if lights.areas is not None and np.any(lights.areas.area == np.inf):
        return
    if lights.ambient is not None and isinstance(integrator, Whitted):
        return
    lamps = [name for name, m in scene.materials.items() if isinstance(m, Emissive)]
    if lights.ambient is not None:
        reason = f"ambient light reaches 'phong' under 'whitted' alone, not '{integrator.type}'"
    elif lights.areas is not None or scene.lights:
        reason = "every light has radiance or intensity 0"
    elif lamps:
        reason = f"no shape has the emissive material '{lamps[0]}'"
    else:
        reason = "there are no lights and no emissive materials"
    yield Mistake(
        f"no light, so that the picture is black: {reason}; expected a light, or "
        "integrator 'ray_cast', which needs none",
        ("lights",) if "lights" in scene.model_fields_set else (),
    )

"""Valid scenes that are probably not what their author meant: the warnings of `render` and
`explain`."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from reference_rt.core.ray import SURFACE_ROUNDING
from reference_rt.core.transform import Rotate, Transform
from reference_rt.integrators import RayCast, Whitted
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.lights import EnvironmentMap, Spot
from reference_rt.materials import Emissive
from reference_rt.scene.build_media import boundaries
from reference_rt.scene.model import SceneModel
from reference_rt.shapes import TABLES as SHAPE_TABLES
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
    found = [*_camera(scene), *_shapes(scene, tables), *_angles(scene)]
    return [*found, *_density(scene, tables), *_darkness(scene, tables)]


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


LOST = 1e-3
"""The largest error of a boundary's points over the length of a free path in a medium: a ray begins
by the former beside its boundary, and about that share of the light that is scattered there is
lost.  Of a ball of radius 1 (albedo 1, sky) 0.02 % is lost at 1e11 / unit, 0.7 % at 1e12, all at
1e16 (measured)."""


def _density(scene: SceneModel, tables: SceneTables) -> Iterator[Mistake]:
    """Media in which light is scattered nearer to their boundary than float64 resolves."""
    error: dict[str, float] = {}
    if not scene.media or isinstance(scene.integrator, RayCast):
        return
    rows = [*boundaries(scene)]
    for _, field, _, module in SHAPE_TABLES:
        table = getattr(tables.geometry.shapes, field)
        if table is None:
            continue
        lower, upper = module.bounds(table)
        reach = np.maximum(np.abs(lower), np.abs(upper)).max(axis=1)
        bound = SURFACE_ROUNDING * (2.0 * reach + (upper - lower).max(axis=1))
        of = np.broadcast_to(table.material, bound.shape)  # one for a whole mesh
        for row in np.unique(of[np.isfinite(bound)]):
            at = (of == row) & np.isfinite(bound)
            for name in {rows[row].interior, rows[row].exterior} - {None}:
                error[str(name)] = max(error.get(str(name), 0.0), float(bound[at].max()))
    for name, bound in error.items():
        medium = scene.media[name]
        densest = max((s for s, a in zip(medium.sigma_t, medium.albedo, strict=True) if a > 0.0),
                      default=0.0) * medium.scale  # fmt: skip
        if densest * bound > LOST:
            yield Mistake(
                f"light travels {1.0 / densest:.3g} in it, and points of its boundary have an "
                f"error of up to {bound:.3g}: light that it scatters is lost; expected a 'sigma_t' "
                f"times 'scale' of at most {LOST / bound:.2g}, or a surface",
                ("media", name),
            )


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

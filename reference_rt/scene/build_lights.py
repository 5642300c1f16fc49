"""The lights of a scene -> Lights: their tables, and how one of them is picked."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from reference_rt.accel.bvh.wide import root_bounds
from reference_rt.accel.geometry import Geometry
from reference_rt.core.arrays import FloatArray
from reference_rt.lights import (
    AREA,
    ENVIRONMENT,
    Ambient,
    Areas,
    Constant,
    EnvironmentMap,
    Goniometric,
    Lights,
    LightSampler,
)
from reference_rt.lights import TABLES as LIGHT_TABLES
from reference_rt.lights.emission import Emission, no_emission
from reference_rt.lights.emitters import constant, environment_map
from reference_rt.lights.selection import bounds
from reference_rt.lights.selection.bounds import LightBounds
from reference_rt.lights.selection.choice import FEW, LightTree, build
from reference_rt.materials.material import Emissive, Material
from reference_rt.scene.build_media import Boundary
from reference_rt.scene.model import SceneModel
from reference_rt.shapes import TABLES as SHAPE_TABLES
from reference_rt.textures import Colours, Palette
from reference_rt.textures.parameter import join, joined
from reference_rt.util.errors import SceneError, together

_PLACED = (AREA, *(code for code, _, _, module in LIGHT_TABLES if hasattr(module, "bounds")))
"""The codes of lights that have a position: a light tree may hold them."""

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

SKY_SHARE = 0.125
"""The highest selection probability of a constant environment beside other lights with power.

BSDF sampling hits a constant environment as well as light sampling does, so that light samples are
better spent on lights that BSDF sampling rarely hits.  By its power, which is that on the whole
scene, it would get most of them.  Measured in 14 scenes with a lamp or a sun: the variance falls to
0.29 to 1.0 of its value, at the median to 0.64.  A quarter and a sixteenth do about as well; powers
of 1/2 fit the strata of the samples.
"""

LEAST_SHARE = 0.125
"""The least selection probability of a light, times their number, before all are divided by their
sum, at most 1 + LEAST_SHARE.

Power says nothing of where the light falls: a sun has that of the whole scene's disk, so that in a
scene of a kilometre a lamp of a watt would get one of a million samples beside a sun of 1 W/m², and
be missing from most pictures.  The variance of scenes that power suits grows by an eighth of itself
at most, and only of those that have a light below this share.  Lights that a tree picks count as
one.
"""


def light_tables(
    scene: SceneModel,
    geometry: Geometry,
    palette: Palette,
    boundaries: Iterable[Boundary],
    environment: Any,
    described: Sequence[Any],
) -> Lights:
    """All lights, selected in proportion to their power, but each sometimes.  Writes the
    primitives' `light` columns.  boundaries: the rows of the materials;  environment: by
    `environment_of`;  described: the scene's lights, by `lights_of`."""
    radius = scene_radius(geometry)
    materials = [scene.materials.get(boundary.material or "") for boundary in boundaries]
    areas, powers = _area_lights(scene, geometry, palette, materials)
    kinds, rows, weights = [AREA] * len(powers), [*range(len(powers))], [powers]
    tables: dict[str, Any] = {}
    for code, field, description, module in LIGHT_TABLES:
        found: list[Any] = [light for light in described if isinstance(light, description)]
        made = [light.tabulate(palette) for light in found]
        tables[field] = joined(module, made) if found else None
        if found:
            kinds += [code] * len(found)
            rows += range(len(found))
            weights.append(module.power(tables[field], radius))
    if environment is not None:
        module = constant if isinstance(environment, constant.Environment) else environment_map
        kinds.append(ENVIRONMENT)
        rows.append(0)
        weights.append(module.power(environment, radius))
    # Overflow is clamped to the largest number; 0 times infinity counts as 0.
    power = np.nan_to_num(np.concatenate(weights), nan=0.0, posinf=np.finfo(np.float64).max)
    choice = _choice(np.array(kinds), np.array(rows), power)
    if choice is not None and isinstance(environment, constant.Environment):
        if scene.integrator.follows_scattered:
            choice = _mostly_others(choice)
    lights = Lights(
        **tables,
        areas=areas,
        environment=environment,
        ambient=_ambient(scene),
        choice=choice,
        tree=None,
    )
    return lights._replace(tree=_tree(lights, geometry, power))


def scene_radius(geometry: Geometry) -> float:
    """Approximate radius of all finite shapes, for the power of distant lights."""
    lower, upper = np.full(3, np.inf), np.full(3, -np.inf)
    for _, field, _, module in SHAPE_TABLES:
        table = getattr(geometry.shapes, field)
        if table is not None and hasattr(module, "extent"):  # quicker, of a large mesh
            low, high = module.extent(table)
            lower, upper = np.minimum(lower, low), np.maximum(upper, high)
        elif table is not None:
            low, high = module.bounds(table)
            finite = np.isfinite(low).all(axis=1) & np.isfinite(high).all(axis=1)
            lower = np.minimum(lower, low[finite].min(axis=0, initial=np.inf))
            upper = np.maximum(upper, high[finite].max(axis=0, initial=-np.inf))
    size = float(np.linalg.norm(upper - lower))
    return 0.5 * size if 0.0 < size < np.inf else 1.0


def _choice(kind: Any, row: Any, weight: FloatArray) -> LightSampler | None:
    """The light sampler by power and LEAST_SHARE; None if no light that is sampled has power."""
    # Scaled by the largest, so that extreme values neither overflow nor vanish in the sum.
    largest = weight.max(initial=0.0)
    if largest == 0.0:
        return None
    weight = weight / largest
    return _choice_by(kind, row, _at_least(kind, weight / weight.sum()))


def _at_least(kind: Any, probability: FloatArray) -> FloatArray:
    """The probabilities (n,), those above 0 raised to LEAST_SHARE over their number at least, and
    divided by their sum."""
    near = (probability > 0.0) & np.isin(kind, _PLACED)
    shares, of_tree = probability, np.zeros(len(probability), bool)
    if np.count_nonzero(near) > FEW:
        of_tree = near
        shares = np.append(np.where(near, 0.0, probability), probability[near].sum())
    least = LEAST_SHARE / np.count_nonzero(shares)
    if (shares[shares > 0.0] >= least).all():
        return probability
    raised = np.where(shares > 0.0, np.maximum(shares, least), 0.0)
    raised /= raised.sum()
    if not of_tree.any():
        return np.asarray(raised)
    return np.where(of_tree, probability * (raised[-1] / shares[-1]), raised[:-1])


def _choice_by(kind: Any, row: Any, probability: FloatArray) -> LightSampler:
    bounded = probability[np.isin(kind, _PLACED)].sum()
    return LightSampler(kind, row, probability, np.cumsum(probability), np.array([bounded]))


def _mostly_others(choice: LightSampler) -> LightSampler:
    """The light sampler with the constant environment, its last light, capped at SKY_SHARE if other
    lights have power."""
    others = choice.probability[:-1]
    power = others.sum()
    if choice.probability[-1] <= SKY_SHARE or power == 0.0:
        return choice
    probability = np.append((1.0 - SKY_SHARE) * (others / power), SKY_SHARE)
    return _choice_by(choice.kind, choice.row, probability)


def _tree(lights: Lights, geometry: Geometry, power: FloatArray) -> LightTree | None:
    """The light tree over lights with a position and power, if there are more than FEW."""
    if lights.choice is None:
        return None
    kind = lights.choice.kind
    placed = np.flatnonzero((power > 0.0) & np.isin(kind, _PLACED))
    if len(placed) <= FEW:
        return None
    bounded = _bounds(lights, geometry, power)
    return build(LightBounds(*(column[placed] for column in bounded)), placed, len(kind))


def _bounds(lights: Lights, geometry: Geometry, power: FloatArray) -> LightBounds:
    """Of the lights that have a position, which come before all others."""
    parts = []
    if lights.areas is not None:
        areas = lights.areas
        intensity = power[: len(areas.area)] / np.pi
        parts.append(bounds.of_areas(geometry.shapes, areas.kind, areas.row, intensity))
    for _, field, _, module in LIGHT_TABLES:
        table = getattr(lights, field)
        if table is not None and hasattr(module, "bounds"):
            parts.append(module.bounds(table))
    return LightBounds(*map(np.concatenate, zip(*parts, strict=True)))


# ---- light that leaves the lamps -----------------------------------------------------------------

_SPHERE = 16.0
"""The sphere around a lamp over the lamp's own: its rays meet the sphere within 4 degrees of the
normal, so that their power varies by 0.2 %."""


def emission_of(scene: SceneModel, geometry: Geometry, lights: Lights) -> Emission:
    """Where a scene's light comes from, for light tracing.  Raises SceneError for lamps whose
    points cannot be sampled, and for light from far away on surfaces without end."""
    if lights.areas is not None and not np.isfinite(lights.areas.area).all():
        raise scene.error(
            "'light' cannot draw points on a lamp that is an infinite plane, a polygon, a quadric, "
            "a torus, or part of a group or of a solid; expected other lamps, or 'path'",
            *("integrator", "type"),
        )
    choice = lights.choice
    if choice is None:
        return no_emission(0)
    n = len(choice.kind)
    found = no_emission(n)
    found.probability[:], found.cumulative[:] = choice.probability, choice.cumulative
    around = _sphere_around(geometry)
    is_placed = np.isin(choice.kind, _PLACED)
    if is_placed.any():
        near, count = _bounds(lights, geometry, np.ones(n)), int(is_placed.sum())
        reach = np.minimum(near.spread + near.reach, np.pi)
        found.centre[:count] = 0.5 * near.lower + 0.5 * near.upper
        found.radius[:count] = 0.5 * _SPHERE * np.linalg.norm(near.upper - near.lower, axis=1)
        # For lamps at points any radius does; that of the scene is no rounding error of it.
        points = found.radius[:count] == 0.0
        found.radius[:count][points] = 1.0 + np.abs(found.centre[:count][points]).max(axis=1)
        found.axis[:count], found.height[:count] = near.axis, 2.0 * np.sin(0.5 * reach) ** 2
    found.is_far[:] = ~is_placed
    if not is_placed.all():
        if not np.isfinite(around).all():
            raise scene.error(
                "'light' cannot send light from far away through a scene that has no end; expected "
                "no infinite plane, or 'path'",
                *("integrator", "type"),
            )
        found.centre[~is_placed], found.radius[~is_placed] = around[:3], around[3]
    return found


def _sphere_around(geometry: Geometry) -> FloatArray:
    """(4,): centre and radius of a sphere that holds all surfaces, inf if there is none."""
    bvh, lower, upper = geometry.bvh, np.full((1, 3), np.inf), np.full((1, 3), -np.inf)
    if bvh is None:
        for _, field, _, module in SHAPE_TABLES:
            table = getattr(geometry.shapes, field)
            if table is not None:
                low, high = module.bounds(table)
                lower, upper = np.concatenate([lower, low]), np.concatenate([upper, high])
    elif bvh.unbounded >= 0:
        return np.full(4, np.inf)
    else:
        lower, upper = root_bounds(bvh)
    low, high = lower.min(axis=0), upper.max(axis=0)
    with np.errstate(invalid="ignore"):
        centre, radius = 0.5 * low + 0.5 * high, 0.5 * np.linalg.norm(high - low)
    if not radius >= 0.0:  # no surface: light passes by
        return np.array([0.0, 0.0, 0.0, 1.0]) if np.isinf(low).all() else np.full(4, np.inf)
    return np.append(centre, radius * (1.0 + 1e-6))


def environment_of(scene: SceneModel) -> Any:
    """The table of a scene's environment; None without one.  Raises SceneError."""
    for i, light in enumerate(scene.lights):
        if isinstance(light, Constant):
            return light.tabulate()
        if isinstance(light, EnvironmentMap):
            try:
                return light.tabulate(scene.folder)
            except ValueError as error:
                raise scene.error(str(error), "lights", i) from None
    return None


def lights_of(scene: SceneModel) -> list[Any]:
    """The scene's lights, with the table of those that name a file of photometry.  Warns of what
    of the file is left out.  Raises SceneError with all files that cannot be used."""
    found: list[Any] = []
    errors: list[SceneError] = []
    for i, light in enumerate(scene.lights):
        left_out = ""
        try:
            if isinstance(light, Goniometric):
                light, left_out = light.read(scene.folder)
        except ValueError as error:
            errors.append(scene.error(str(error), "lights", i))
        if left_out:
            scene.warn(f"of the file is left out {left_out}", "lights", i, "file")
        found.append(light)
    if errors:
        raise together(errors)
    return found


def _ambient(scene: SceneModel) -> FloatArray | None:
    found = [light.radiance for light in scene.lights if isinstance(light, Ambient)]
    return np.sum(found, axis=0)[None] if found else None


def _area_lights(
    scene: SceneModel, geometry: Geometry, palette: Palette, materials: Sequence[Material | None]
) -> tuple[Areas | None, FloatArray]:
    """The emissive primitives, and the luminance of their power: pi times area times radiance (for
    a texture its maximum).  It is 0 for primitives that only BSDF-sampled rays hit: those of types
    that cannot be sampled, and parts of groups and of solids."""
    lamps = {k: m for k, m in enumerate(materials) if isinstance(m, Emissive)}
    if not lamps:
        return None, np.zeros(0)
    emissive = [*lamps]
    radiance, brightness = _radiances([*lamps.values()], palette)
    kinds, rows, numbers, areas = [], [], [], []
    start = 0
    for code, field, _, module in SHAPE_TABLES:
        table = getattr(geometry.shapes, field)
        if table is None:
            continue
        mine = np.flatnonzero(np.isin(table.material, emissive))
        # In the order of the scene: that of the rows depends on the acceleration structure.
        mine = mine[np.lexsort((table.face[mine], table.owner[mine]))]
        area = np.full(len(mine), np.inf)
        if hasattr(module, "sample"):
            of_scene = table.owner[mine] < len(scene.shapes)
            area[of_scene] = module.areas(table)[mine[of_scene]]
        table.light[mine] = start + np.arange(len(mine))
        start += len(mine)
        kinds.append(np.full(len(mine), code))
        rows.append(mine)
        numbers.append(np.searchsorted(emissive, table.material[mine]))
        areas.append(area)
    if start == 0:
        return None, np.zeros(0)
    number, area = np.concatenate(numbers), np.concatenate(areas)
    columns = Colours(
        radiance.value[number], None if radiance.texture is None else radiance.texture[number]
    )
    table = Areas(np.concatenate(kinds), np.concatenate(rows), columns, area)
    power = np.pi * area * brightness[number]
    return table, np.where(np.isfinite(power), power, 0.0)


def _radiances(lamps: Sequence[Emissive], palette: Palette) -> tuple[Colours, FloatArray]:
    """The radiance of each emissive material, and its maximum luminance."""
    columns, brightness = [], []
    for material in lamps:
        columns.append(palette.colours(material.radiance, np.inf))
        if isinstance(material.radiance, str):
            brightness.append(palette.greatest[palette.numbers_of[material.radiance]])
        else:
            brightness.append(float(_LUMINANCE @ material.radiance))
    return join(columns), np.array(brightness)

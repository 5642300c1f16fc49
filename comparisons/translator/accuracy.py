"""Relative errors of a scene's materials that a comparison must allow for: of our tables, and of
Mitsuba's formulas in float32."""

from collections.abc import Iterator

from comparisons.materials import type_of
from comparisons.materials.material import Errors
from reference_rt.materials import Bump, Emissive, Mask, Material, NormalMap, Wrapper
from reference_rt.rendering.scene import Scene


def accuracy(scene: Scene, name: str | None) -> float:
    """The relative error of the light that material `name` scatters, by our tables or in Mitsuba; 0
    for exact materials, and for None."""
    return max((errors.relative(m) for m, errors in _errors(scene, name)), default=0.0)


def coat_error(scene: Scene, name: str | None) -> float:
    """The absolute error of light that passes a coat, as a fraction of the brightest such light; 0
    for materials without a coat, and for None."""
    return max((errors.absolute(m) for m, errors in _errors(scene, name)), default=0.0)


def _errors(scene: Scene, name: str | None) -> list[tuple[Material, Errors]]:
    """Of the materials that material `name` is made of, those that are not exact."""
    both = ((material, type_of(material).errors) for material in _leaves(scene, name))
    return [(material, errors) for material, errors in both if errors is not None]


def is_tilted(scene: Scene, name: str | None) -> bool:
    """Whether material `name` has a bump or normal map on the outside, under wrappers at most."""
    if name is None:
        return False
    material = scene.materials[name]
    if isinstance(material, Bump | NormalMap):
        return True
    fields = material.bases if isinstance(material, Wrapper) else ("base",)
    return any(is_tilted(scene, getattr(material, field, None)) for field in fields)


def lets_pass(scene: Scene, name: str | None) -> bool:
    """Whether material `name` may let light pass to the other side: refracted, straight, or through
    a mask."""
    if name is None:
        return False
    material = scene.materials[name]
    if isinstance(material, Mask):
        return True
    if isinstance(material, Wrapper | Emissive):
        return any(lets_pass(scene, getattr(material, field)) for field in _fields(material))
    return material.transmits


def _fields(material: Wrapper | Emissive) -> tuple[str, ...]:
    """The fields that name the materials that it is made of."""
    return material.bases if isinstance(material, Wrapper) else ("base",)


def _leaves(scene: Scene, name: str | None) -> Iterator[Material]:
    """The materials that material `name` is made of."""
    if name is None:
        return
    material: Material = scene.materials[name]
    if isinstance(material, Wrapper | Emissive):
        for field in _fields(material):
            yield from _leaves(scene, getattr(material, field))
    else:
        yield material

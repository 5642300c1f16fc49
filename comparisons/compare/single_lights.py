"""Pictures of a scene under each light alone, to recognise a lost or doubled light."""

from collections.abc import Iterator, Mapping

from reference_rt.core.arrays import FloatArray
from reference_rt.lights import Ambient, Point
from reference_rt.materials import AnyMaterial, Emissive
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene

MOST = 8
"""Number of lights above which a missing one is hard to recognise."""

SAMPLES = 64
"""Samples per pixel: enough to recognise a light in a difference."""

DARK = (0.0, 0.0, 0.0)

OUT = Point(position=(0.0, 0.0, 0.0), intensity=(0.0, 0.0, 0.0))
"""A light that is out."""


def single_lights(
    scene: Scene, spp: int = SAMPLES, threads: int | None = None
) -> Mapping[str, FloatArray]:
    """Our picture (height, width, 3) under each light or emissive material alone, by its name;
    empty if there are fewer than two, or more than MOST."""
    if not 2 <= len(list(each_alone(scene))) <= MOST:
        return {}
    sampler = scene.resolved_sampler
    if hasattr(sampler, "seed"):
        sampler = sampler.model_copy(update={"spp": spp})
    return {
        name: render(one.changed(sampler=sampler), threads=threads).colour
        for name, one in each_alone(scene)
    }


def each_alone(scene: Scene) -> Iterator[tuple[str, Scene]]:
    """The scene under each light or emissive material alone, by its name."""
    for name in _shining(scene):
        yield f"the material '{name}'", scene.changed(lights=(), materials=_only(scene, name))
    for k in _lights(scene):
        light = scene.lights[k]
        one = scene.changed(lights=(light,), materials=_only(scene, None))
        yield f"lights[{k}] ({light.type})", one


def without_each(scene: Scene) -> Iterator[tuple[str, Scene]]:
    """The scene without one of its lights or emissive materials, by its name; nothing if there are
    fewer than two, or more than MOST.  The others keep their places."""
    shining, lights = _shining(scene), _lights(scene)
    if not 2 <= len(shining) + len(lights) <= MOST:
        return
    for name in shining:
        dark = scene.materials[name].model_copy(update={"radiance": DARK})
        yield f"the material '{name}'", scene.changed(materials={**scene.materials, name: dark})
    for k in lights:
        light = scene.lights[k]
        others = (*scene.lights[:k], OUT, *scene.lights[k + 1 :])
        yield f"lights[{k}] ({light.type})", scene.changed(lights=others)


def _shining(scene: Scene) -> list[str]:
    """The names of emissive materials."""
    return [name for name, m in scene.materials.items() if isinstance(m, Emissive)]


def _lights(scene: Scene) -> list[int]:
    """The places of lights that light reaches surfaces from."""
    return [k for k, light in enumerate(scene.lights) if not isinstance(light, Ambient)]


def _only(scene: Scene, name: str | None) -> dict[str, AnyMaterial]:
    """The scene's materials; all emissive ones but `name` are dark."""
    return {
        other: material.model_copy(update={"radiance": DARK})
        if isinstance(material, Emissive) and other != name
        else material
        for other, material in scene.materials.items()
    }

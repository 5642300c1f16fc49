"""Scene -> Mitsuba dict: one `singledispatch` function per public type.

To translate a new type: register a function for it in the file of its kind; until then it raises
`UntranslatableError`, which makes a scene `not-comparable`.
"""

from typing import Any

from comparisons.mitsuba_backend import mitsuba
from comparisons.mitsuba_scene import light_id, shape_id
from comparisons.translate.cameras import translate_camera
from comparisons.translate.errors import UntranslatableError
from comparisons.translate.film import translate_film, translate_sampler
from comparisons.translate.integrators import translate_integrator
from comparisons.translate.lights import translate_light
from comparisons.translate.materials import parts_of
from comparisons.translate.shapes import translate_shape
from reference_rt.scene import Scene


def to_mitsuba(scene: Scene) -> dict[str, Any]:
    """The scene as a dict for `mitsuba.load_dict`; shape i of ours has the id "shape_<i>".

    Meshes are Mitsuba objects already, made of the very triangles of our tables.  There is no
    integrator where ours is ray casting.  Raises UntranslatableError, SceneError for a file that
    cannot be used, ReferenceUnavailableError without Mitsuba.
    """
    sensor = translate_camera(scene.camera)
    sensor["film"] = translate_film(scene.film)
    sensor["sampler"] = translate_sampler(scene.resolved_sampler)
    result: dict[str, Any] = {
        "type": "scene",
        # Without it Embree drops rays that meet a shared edge (Mitsuba issue 1149).
        "embree_use_robust_intersections": True,
        "sensor": sensor,
    }
    integrator = translate_integrator(scene.integrator)
    if integrator is not None:
        result["integrator"] = integrator
    for i, shape in enumerate(scene.shapes):
        parts = parts_of(shape.material, scene.materials)
        try:
            result[shape_id(i)] = translate_shape(shape, scene.folder, parts)
        except ValueError as error:
            raise scene.error(str(error), "shapes", i) from None
    for i, light in enumerate(scene.lights):
        result[light_id(i)] = translate_light(light)
    return result


def load(scene: Scene) -> Any:
    """The scene as Mitsuba's own object, its shapes not merged.  Raises as `to_mitsuba` does."""
    return mitsuba().load_dict(to_mitsuba(scene), optimize=False)


__all__ = ["UntranslatableError", "load", "to_mitsuba"]

"""Faults of scenes, of shapes, instances, cameras and lights."""

from collections.abc import Callable
from typing import Any

from comparisons.experiments.selftest.fault import SceneFault
from comparisons.experiments.selftest.of_scenes import entry, part
from reference_rt.core.transform import Rotate, Scale, Turn
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Box, Cone, Cylinder, Quadric, Torus


def transformed(of: str, index: int, *steps: Any) -> Callable[[Scene], Scene]:
    """Add transforms to an entry of the "shapes" or "lights", before its own."""

    def change(scene: Scene) -> Scene:
        return entry(of, index, transform=(*steps, *getattr(scene, of)[index].transform))(scene)

    return change


def first(kind: type, **fields: Any) -> Callable[[Scene], Scene]:
    """Change fields of the first shape of a kind."""

    def change(scene: Scene) -> Scene:
        index = next(k for k, shape in enumerate(scene.shapes) if isinstance(shape, kind))
        return entry("shapes", index, **fields)(scene)

    return change


def without(index: int) -> Callable[[Scene], Scene]:
    """Leave out a shape."""

    def change(scene: Scene) -> Scene:
        return scene.changed(shapes=scene.shapes[:index] + scene.shapes[index + 1 :])

    return change


def operand(**fields: Any) -> Callable[[Scene], Scene]:
    """Change fields of the first operand of the first solid."""

    def change(scene: Scene) -> Scene:
        solid = scene.shapes[0]
        operands = getattr(solid, "of")  # noqa: B009
        changed = operands[0].model_copy(update=fields)
        return entry("shapes", 0, of=(changed, *operands[1:]))(scene)

    return change


def _operands_turned_round(scene: Scene) -> Scene:
    operands = getattr(scene.shapes[0], "of")  # noqa: B009
    return entry("shapes", 0, of=(operands[1], operands[0], *operands[2:]))(scene)


def turned(degrees: float) -> Rotate:
    """About the y axis."""
    return Rotate(rotate=Turn(axis=(0.0, 1.0, 0.0), degrees=degrees))


FAULTS = (
    SceneFault("lens 5 % wider", "camera_thin_lens", part("camera", aperture_radius=0.231)),
    SceneFault("focus 5 % too far", "camera_thin_lens", part("camera", focus_distance=5.29)),
    SceneFault("view rectangle in the middle", "camera_view_rectangle",
               part("camera", view=(-0.6, 0.6, -0.45, 0.45))),
    SceneFault("width of parallel rays +0.1 %", "display_modes", part("camera", width=7.4074)),
    SceneFault("film of a pinhole too near", "camera_pinhole",
               part("camera", film_distance=0.1602)),
    SceneFault("cut-off of a spot 1 degree wider", "light_spot",
               entry("lights", 0, cutoff_angle=19)),
    SceneFault("beam of a spot 1 degree wider", "light_spot", entry("lights", 1, beam_width=5)),
    SceneFault("sun turned by half a degree", "light_directional",
               entry("lights", 0, direction=(-1.0, -2.0, -1.5256))),
    SceneFault("sky turned by a degree", "environment", transformed("lights", 0, turned(1.0))),
    SceneFault("sky mirrored", "environment",
               transformed("lights", 0, Scale(scale=(-1.0, 1.0, 1.0)))),
    SceneFault("lamp turned over", "colour_bleeding",
               transformed("shapes", 5, Scale(scale=(1.0, 1.0, -1.0)))),
    SceneFault("one lamp of five lost", "light_shapes", without(5)),
    SceneFault("mirrored instance not mirrored", "layers",
               transformed("shapes", 4, Scale(scale=(-1.0, 1.0, 1.0)))),
    SceneFault("transforms of an instance in reverse", "transforms",
               lambda scene: entry(
                   "shapes", 5, transform=tuple(reversed(scene.shapes[5].transform)))(scene)),
    SceneFault("flat shading of a smooth mesh", "mesh_knot",
               entry("shapes", 0, face_normals=True)),
    SceneFault("fill rule even-odd for non-zero", "polygons_fill_rules",
               entry("shapes", 1, fill="even_odd")),
    SceneFault("tube of a torus 0.1 % thicker", "cylinders_and_cones",
               first(Torus, minor_radius=0.2002)),
    SceneFault("caps of a cone lost", "cylinders_and_cones", first(Cone, capped=False)),
    SceneFault("cylinder 0.1 % shorter", "cylinders_and_cones", first(Cylinder, z_max=0.7992)),
    SceneFault("mixed term of a quadric off by 1 %", "quadrics",
               first(Quadric, coefficients=(1, 1, 2, 0.505, 0, 0, 0, 0, 0, -1))),
    SceneFault("difference of a solid in reverse", "csg_inside", _operands_turned_round),
    SceneFault("operand of a solid 0.1 % larger", "csg_inside", operand(radius=3.003)),
    SceneFault("box of a solid lost its turn", "transforms", first(Box, transform=())),
    SceneFault("one mirror image less", "whitted_classic", part("integrator", max_depth=1)),
)  # fmt: skip

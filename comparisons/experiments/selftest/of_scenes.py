"""Faults of scenes: we render a slightly changed scene, Mitsuba the original."""

import atexit
import functools
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from comparisons.experiments.selftest.fault import SceneFault
from reference_rt.cameras.film import TentFilter
from reference_rt.core.transform import Rotate, Scale, Translate, Turn
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Box, Cone, Cylinder, Mesh, Quadric, Torus
from reference_rt.util.files import read_text, temporary_folder

Change = Callable[[Scene], Scene]


def _with(part: Any, fields: dict[str, Any]) -> Any:
    """A part with other fields, each a value or a function of the value that it has."""
    new = {key: x(getattr(part, key)) if callable(x) else x for key, x in fields.items()}
    return part.model_copy(update=new)


def part(name: str, **fields: Any) -> Change:
    """Change fields of the camera, the film or the integrator."""
    return lambda scene: scene.changed(**{name: _with(getattr(scene, name), fields)})


def named(section: str, name: str, fields: dict[str, Any]) -> Change:
    """Change fields of one of the "materials" or "textures"."""

    def change(scene: Scene) -> Scene:
        parts = getattr(scene, section)
        return scene.changed(**{section: {**parts, name: _with(parts[name], fields)}})

    return change


def material(name: str, **fields: Any) -> Change:
    """Change fields of a material."""
    return named("materials", name, fields)


def texture(name: str, **fields: Any) -> Change:
    """Change fields of a texture."""
    return named("textures", name, fields)


def uv(name: str, **fields: Any) -> Change:
    """Change fields of a texture's map of uv."""
    return texture(name, uv=lambda place: _with(place, fields))


def entry(of: str, index: int, /, **fields: Any) -> Change:
    """Change fields of an entry of the "shapes" or "lights"."""

    def change(scene: Scene) -> Scene:
        entries = list(getattr(scene, of))
        entries[index] = _with(entries[index], fields)
        return scene.changed(**{of: tuple(entries)})

    return change


def transformed(of: str, index: int, *steps: Any) -> Change:
    """Add transforms to an entry of the "shapes" or "lights", before its own."""
    return entry(of, index, transform=lambda own: (*steps, *own))


def first(kind: type, **fields: Any) -> Change:
    """Change fields of the first shape of a kind."""

    def change(scene: Scene) -> Scene:
        index = next(k for k, shape in enumerate(scene.shapes) if isinstance(shape, kind))
        return entry("shapes", index, **fields)(scene)

    return change


def without(index: int) -> Change:
    """Leave out a shape."""
    return lambda scene: scene.changed(shapes=scene.shapes[:index] + scene.shapes[index + 1 :])


def operand(**fields: Any) -> Change:
    """Change fields of the first operand of the first solid."""
    return entry("shapes", 0, of=lambda own: (_with(own[0], fields), *own[1:]))


def turned(degrees: float) -> Rotate:
    """About the y axis."""
    return Rotate(rotate=Turn(axis=(0.0, 1.0, 0.0), degrees=degrees))


LAMP = 5
"""Index of the lamp among the shapes of `colour_bleeding`."""


@functools.cache
def _folder() -> Path:
    """The folder of changed meshes; removed when the process ends."""
    stack = ExitStack()
    atexit.register(stack.close)
    return stack.enter_context(temporary_folder())


def _one_face_flipped(scene: Scene) -> Scene:
    """The scene with one face of its first shape, an .obj mesh, wound in reverse."""
    mesh = scene.shapes[0]
    assert isinstance(mesh, Mesh)
    assert mesh.file is not None
    lines = read_text(scene.folder / mesh.file).splitlines()
    faces = [k for k, line in enumerate(lines) if line.startswith("f ")]
    # Face number n / 20: an ordinary one that the camera sees.
    flipped = faces[len(faces) // 20]
    head, *corners = lines[flipped].split()
    lines[flipped] = " ".join([head, *reversed(corners)])
    file = _folder() / "one_face_flipped.obj"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return entry("shapes", 0, file=str(file))(scene)


FAULTS = (
    SceneFault("one face flipped in a mesh", "mesh_knot", _one_face_flipped),
    SceneFault(
        "stale reference: the lamp 2 cm aside", "colour_bleeding",
        entry("shapes", LAMP,
              transform=lambda own: (*own, Translate(translate=(0.02, 0.0, 0.0)))),
    ),
    SceneFault("a light lost", "caustic_glass", lambda scene: scene.changed(lights=())),
    SceneFault("max_depth less by one", "cornell_box", part("integrator", max_depth=7)),
    SceneFault("direct light alone", "colour_bleeding", part("integrator", max_depth=2)),
    SceneFault(
        "albedo +1 %", "colour_bleeding", material("white", reflectance=(0.7575, 0.7575, 0.7575))
    ),
    SceneFault(
        "eta swapped", "caustic_glass", material("glass", interior_ior=1.0, exterior_ior=1.5)
    ),
    SceneFault("glass of 1.52", "caustic_glass", material("glass", interior_ior=1.52)),
    SceneFault("radius +0.1 %", "caustic_glass", entry("shapes", 0, radius=0.7007)),
    SceneFault("field of view +0.1 degrees", "colour_bleeding", part("camera", fov=40.1)),
    SceneFault(
        "roughness +5 %", "material_rough_conductor", material("sample", alpha=(0.0525, 0.315))
    ),
    SceneFault(
        "anisotropy turned", "material_rough_conductor", material("sample", alpha=(0.3, 0.05))
    ),
    SceneFault("texture turned", "material_rough_conductor", uv("tiles", scale=(6.0, -6.0))),
    SceneFault("sky +1 %", "environment", entry("lights", 0, scale=0.808)),
    SceneFault(
        "filter of another width", "filter_tent", part("film", filter=TentFilter(radius=1.1))
    ),
)  # fmt: skip


OF_MATERIALS = (
    SceneFault("k of a metal 5 % up", "material_conductor",
               material("sample", k=(4.1076, 2.5746, 2.2491))),
    SceneFault("eta and k exchanged", "material_conductor",
               material("sample", eta=(3.912, 2.452, 2.142), k=(0.2, 0.924, 1.102))),
    SceneFault("eta of a metal in the order b, g, r", "material_conductor",
               material("sample", eta=(1.102, 0.924, 0.2))),
    SceneFault("coat of 1.45 for 1.5", "material_plastic", material("sample", interior_ior=1.45)),
    SceneFault("plastic nonlinear", "material_plastic", material("sample", nonlinear=True)),
    SceneFault("rough plastic linear", "material_rough_plastic",
               material("sample", nonlinear=False)),
    SceneFault("roughness squared once more", "material_rough_dielectric",
               material("sample", alpha=(0.0625, 0.0625))),
    SceneFault("Beckmann for GGX in glass", "material_rough_dielectric",
               material("sample", distribution="beckmann")),
    SceneFault("GGX for Beckmann in metal", "material_rough_conductor_beckmann",
               material("sample", distribution="ggx")),
    SceneFault("pane of 1.6 for 1.5", "material_thin_dielectric",
               material("sample", interior_ior=1.6)),
    SceneFault("both sides alike", "material_two_sided", material("strip", back=None)),
    SceneFault("sides exchanged", "material_two_sided",
               material("strip", base="silver", back="green")),
    SceneFault("blend exchanged", "material_blend", material("worn", first="rust", second="steel")),
    SceneFault("weight of a blend turned upside down", "material_blend",
               uv("patches", scale=(2.0, -1.0))),
    SceneFault("mask ignored", "material_mask", material("shell", opacity=1.0)),
    SceneFault("holes shifted by a hundredth", "material_mask", uv("holes", offset=(0.01, 0.0))),
    SceneFault("bump 10 % too high", "material_bump", material("hammered", scale=0.088)),
    SceneFault("dents for bumps", "material_bump", material("hammered", scale=-0.08)),
    SceneFault("normal map read as sRGB", "material_normal_map", texture("dents", encoding="srgb")),
    SceneFault("normal map upside down", "material_normal_map", uv("dents", scale=(1.0, -1.0))),
    SceneFault("clear coat lost", "material_principled", material("paint", clearcoat=0.0)),
    SceneFault("sheen without tint", "material_principled", material("cloth", sheen_tint=0.0)),
    SceneFault("metallic 0.45 for 0.4", "material_principled", material("paint", metallic=0.45)),
    SceneFault("exponent 40 for 32", "phong_spheres", material("p2", exponent=40.0)),
    SceneFault("half vector for mirrored direction", "phong_spheres",
               material("p1", half_vector=True)),
    SceneFault("nearest for bilinear", "texture_filters", texture("smooth", filter="nearest")),
    SceneFault("repeat for mirror", "texture_filters", texture("flipped", wrap="repeat")),
    SceneFault("repeat for clamp", "texture_filters", texture("blocks", wrap="repeat")),
    SceneFault("texture turned by a degree", "texture_filters", uv("smooth", rotate=31.0)),
    SceneFault("texture upside down", "texture_filters", uv("smooth", scale=(2.0, -2.0))),
    SceneFault("image read as linear", "texture_filters", texture("smooth", encoding="raw")),
    SceneFault("colours of a checker exchanged", "whitted_classic",
               texture("squares", first=(0.9, 0.8, 0.1), second=(0.9, 0.1, 0.05))),
    SceneFault("texture of roughness ignored", "texture_roughness",
               uv("wear", scale=(1.0, 1.0))),
)  # fmt: skip


OF_SHAPES = (
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
               entry("shapes", 5, transform=lambda own: own[::-1])),
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
    SceneFault("difference of a solid in reverse", "csg_inside",
               entry("shapes", 0, of=lambda own: (own[1], own[0], *own[2:]))),
    SceneFault("operand of a solid 0.1 % larger", "csg_inside", operand(radius=3.003)),
    SceneFault("box of a solid lost its turn", "transforms", first(Box, transform=())),
)  # fmt: skip

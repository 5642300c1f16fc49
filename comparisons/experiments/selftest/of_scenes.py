"""Faults of scenes: we render a slightly changed scene, Mitsuba the original."""

import functools
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from comparisons.experiments.selftest.fault import SceneFault
from reference_rt.cameras.filters import TentFilter
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Mesh
from reference_rt.util.files import read_text


def material(name: str, **fields: Any) -> Callable[[Scene], Scene]:
    """Change fields of a material."""

    def change(scene: Scene) -> Scene:
        changed = scene.materials[name].model_copy(update=fields)
        return scene.changed(materials={**scene.materials, name: changed})

    return change


def entry(of: str, index: int, /, **fields: Any) -> Callable[[Scene], Scene]:
    """Change fields of an entry of the "shapes" or "lights"."""

    def change(scene: Scene) -> Scene:
        entries = list(getattr(scene, of))
        entries[index] = entries[index].model_copy(update=fields)
        return scene.changed(**{of: tuple(entries)})

    return change


def part(name: str, **fields: Any) -> Callable[[Scene], Scene]:
    """Change fields of the camera, the film or the integrator."""

    def change(scene: Scene) -> Scene:
        return scene.changed(**{name: getattr(scene, name).model_copy(update=fields)})

    return change


LAMP = 5
"""Index of the lamp among the shapes of `colour_bleeding`."""


def _lamp_moved(scene: Scene) -> Scene:
    from reference_rt.core.transform import Translate

    lamp = scene.shapes[LAMP]
    moved = lamp.model_copy(
        update={"transform": (*lamp.transform, Translate(translate=(0.02, 0.0, 0.0)))}
    )
    shapes = list(scene.shapes)
    shapes[LAMP] = moved
    return scene.changed(shapes=tuple(shapes))


def _texture_turned(scene: Scene) -> Scene:
    tiles = scene.textures["tiles"]
    uv = tiles.uv.model_copy(update={"scale": (6.0, -6.0)})
    return scene.changed(textures={**scene.textures, "tiles": tiles.model_copy(update={"uv": uv})})


@functools.cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    """The folder of changed meshes; removed when the process ends."""
    return tempfile.TemporaryDirectory(prefix="reference_rt_selftest_")


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
    file = Path(_folder().name) / "one_face_flipped.obj"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return entry("shapes", 0, file=str(file))(scene)


FAULTS = (
    SceneFault("one face flipped in a mesh", "mesh_knot", _one_face_flipped),
    SceneFault("stale reference: the lamp 2 cm aside", "colour_bleeding", _lamp_moved),
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
    SceneFault("texture turned", "material_rough_conductor", _texture_turned),
    SceneFault("sky +1 %", "environment", entry("lights", 0, scale=0.808)),
    SceneFault(
        "filter of another width", "filter_tent", part("film", filter=TentFilter(radius=1.1))
    ),
)  # fmt: skip

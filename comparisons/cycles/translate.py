"""Scene -> Cycles: raises NoCounterpartError for what Cycles does not compute exactly.  What it has
of materials and textures stands in their files, `comparisons.materials` and `comparisons.textures`.

Contract: the functions return plain data that `worker` reads: numbers, lists, names of .npy and
.npz files beside it.  They take descriptions, never tables; maps are of `geometry.affine`, files
are read by `mitsuba.second`.
"""

import json
import math
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons import shapes
from comparisons.cameras import type_of as type_of_camera
from comparisons.cycles.media import Volumes
from comparisons.cycles.surfaces import placed_arrays, triangles_of, type_name
from comparisons.geometry import affine
from comparisons.geometry.flatten import Leaf, copies_of, place_of
from comparisons.geometry.frame import SHARE, round32
from comparisons.integrators import type_of as type_of_integrator
from comparisons.lights import type_of as type_of_light
from comparisons.materials import type_of as type_of_material
from comparisons.renderers import NoCounterpartError, Reasons
from comparisons.renderers.vocabulary import Data, plain_rgb
from comparisons.shapes.soup import Soup
from comparisons.textures import type_of as type_of_texture
from comparisons.translator.moved import frame_of, moved
from reference_rt.cameras.film import BoxFilter
from reference_rt.core.arrays import FloatArray
from reference_rt.materials import Emissive
from reference_rt.rendering.scene import Scene

MOST_BOUNCES = 1024
"""Cycles' own limit."""

MOST_MIRRORINGS = 100
"""Edges of a path above which mirrors do not vote: float32's error of a direction grows with each,
and after a thousand the picture of `deep_mirrors` is 0.6 % off where it vanishes (measured)."""

MOST_TRIANGLES = 5_000_000
"""Most triangles of all copies: Cycles is given each copy."""


@dataclass
class Writing:
    """A scene being written.  folder: of its files;  files: how many there are;  named: the
    materials, with their volumes;  shaders: by the material's name;  reasons: why Cycles is not
    eligible;  glass, lamps: the boxes (2, 3) around shapes of glass, and around those that emit;
    reach: the largest coordinate of a vertex;  volumes: of its media."""

    scene: Scene
    folder: Path
    files: int = 0
    named: dict[str, Data] = field(default_factory=dict)
    shaders: dict[str | None, Data] = field(default_factory=dict)
    reasons: Reasons = field(default_factory=Reasons)
    glass: list[FloatArray] = field(default_factory=list)
    lamps: list[FloatArray] = field(default_factory=list)
    reach: float = 0.0
    volumes: Volumes = field(init=False)

    def __post_init__(self) -> None:
        self.volumes = Volumes(self.scene)

    def colour(self, value: Any) -> Any:
        """A colour, or the texture of this name.  Raises NoCounterpartError."""
        if not isinstance(value, str):
            return plain_rgb(value)
        texture = self.scene.textures[value]
        if (to_cycles := type_of_texture(texture).to_cycles) is None:
            raise NoCounterpartError(f"the texture {texture.type}")
        if texture.uv_set:
            raise NoCounterpartError(f"a texture with 'uv_set: {texture.uv_set}'")
        return to_cycles(texture, self)

    def number(self, value: Any) -> Any:
        """A number, or the texture of this name.  Raises NoCounterpartError."""
        return self.colour(value) if isinstance(value, str) else float(value)

    def shader(self, name: str | None) -> Data:
        """The shader of a material: black from behind where the material is.  Raises
        NoCounterpartError."""
        material = rt.Diffuse() if name is None else self.scene.materials[name]
        if (to_cycles := type_of_material(material).to_cycles) is None:
            raise NoCounterpartError(f"the material {material.type}")
        return to_cycles(material, self)

    def shader_of(self, name: str | None) -> Data:
        """The same, made once."""
        if name not in self.shaders:
            self.shaders[name] = self.shader(name)
        return self.shaders[name]

    def save(self, array: FloatArray | None = None, **arrays: Any) -> str:
        """The name of a new file that holds an array, or arrays by name."""
        self.files += 1
        if array is not None:
            name = f"{self.files}.npy"
            np.save(self.folder / name, array)
        else:
            name = f"{self.files}.npz"
            np.savez(self.folder / name, **arrays)
        return name


def write(scene: Scene, folder: Path, threads: int | None = None) -> None:
    """Write a scene for `worker` into a folder, in the coordinates that suit float32 best.  Raises
    NoCounterpartError with all reasons, SceneError for a file that cannot be used."""
    writing = Writing(moved(scene, frame_of(scene)), folder)
    scene = writing.scene
    found: Data = {"threads": threads or 0, "lights": [], "materials": writing.named}
    background = np.zeros(3)
    with writing.reasons.collected():
        found["bounces"] = bounces_of(scene.integrator)
        if found["bounces"] > MOST_MIRRORINGS and any(
            isinstance(m, rt.Mirror | rt.Conductor) for m in scene.materials.values()
        ):
            raise NoCounterpartError(f"mirrors along paths of more than {MOST_MIRRORINGS} edges")
    with writing.reasons.collected():
        found["volume"] = writing.volumes.world()
    with writing.reasons.collected():
        found["camera"] = camera_of(scene.camera, scene.film)
    for light in scene.lights:
        with writing.reasons.collected():
            to_cycles = type_of_light(light).to_cycles
            if to_cycles is None:
                raise NoCounterpartError(f"the light {light.type}")
            data = to_cycles(light)
            if data["type"] == "BACKGROUND":
                background += data["colour"]
            else:
                found["lights"].append(data)
    found["background"] = background.tolist()
    found["meshes"] = _meshes(writing)
    with writing.reasons.collected():
        _check_places(writing)
    for check in (writing.volumes.check_places, writing.volumes.check_lamps):
        with writing.reasons.collected():
            check()
    writing.reasons.check()
    (folder / "scene.json").write_text(json.dumps(found), encoding="utf-8")


def obstacles(scene: Scene) -> list[str]:
    """Why Cycles does not vote on a scene, rendered with a box filter; [] if it does."""
    film = scene.film.model_copy(update={"filter": BoxFilter(), "layers": ()})
    with tempfile.TemporaryDirectory() as folder:
        try:
            write(scene.changed(film=film), Path(folder))
        except NoCounterpartError as error:
            return str(error).split("; ")
    return []


def bounces_of(integrator: Any) -> int:
    """Cycles' bounces: edges of a path without the first and the last one."""
    if getattr(integrator, "hide_emitters", False):
        raise NoCounterpartError("lamps that cameras do not see")
    edges_of = type_of_integrator(integrator).edges
    if edges_of is None:
        raise NoCounterpartError(f"the integrator {integrator.type}")
    edges = edges_of(integrator)
    if edges is not None and edges < 2:
        raise NoCounterpartError("emission alone (max_depth below 2)")
    return MOST_BOUNCES if edges is None else min(edges - 2, MOST_BOUNCES)


# ---- cameras -------------------------------------------------------------------------------------


def camera_of(camera: Any, film: Any) -> Data:
    """The camera looks along its -z, with +y up.  width: of what it sees at distance 1, or of an
    orthographic view;  shift: of that rectangle, in widths;  aspect: width over height of a
    pixel."""
    of = type_of_camera(camera)
    if not isinstance(film.filter, BoxFilter):
        raise NoCounterpartError(f"the filter {film.filter.type}")
    eye, target = np.array(camera.eye), np.array(camera.target)
    back = eye - target
    right = np.cross(camera.up, back)
    axes = np.stack([right, np.cross(back, right), back], axis=1)
    axes /= np.linalg.norm(axes, axis=0)
    l, r, b, t = of.edges(camera, film)
    if of.is_upside_down:
        axes[:, :2] *= -1.0
    width, height = r - l, t - b
    lens = of.lens(camera)
    if lens and lens.focus < 0.0:
        raise NoCounterpartError("a pinhole whose hole has a size")
    return {
        "type": "ORTHO" if of.is_parallel else "PERSP",
        "matrix": np.column_stack([axes, eye]).tolist(),
        "width": width,
        "shift": [(l + r) / 2.0 / width, (b + t) / 2.0 / width],
        "aspect": width / film.width / (height / film.height),
        "resolution": [film.width, film.height],
        # Cycles' near plane is not 0: of a scene of unit size it is nothing.
        "clip": [camera.near or 1e-5, camera.far or 1e6],
        "aperture": lens.radius if lens else 0.0,
        "focus": lens.focus if lens else 1.0,
    }


# ---- shapes --------------------------------------------------------------------------------------


def _meshes(writing: Writing) -> list[Data]:
    """The meshes of all copies.  Instances share their files, and have matrices."""
    scene, found, triangles = writing.scene, [], 0
    made: dict[int, Soup] = {}
    shared: dict[int, str] = {}
    for copy in copies_of(scene):
        for member in copy.members:
            for leaf in member.leaves:
                with writing.reasons.collected():
                    if member.tree is not None:
                        raise NoCounterpartError("solids (CSG)")
                    key, kind = id(leaf.shape), type_name(leaf.shape)
                    if key not in made:
                        made[key] = triangles_of(leaf.shape, scene.folder)
                    surface, shader = made[key], writing.shader_of(leaf.material)
                    if surface.uvs is None and _has_texture(shader):
                        raise NoCounterpartError(f"the shape {kind} under a texture")
                    m = affine.map_in(leaf.shape, place_of(scene, leaf, copy.outer))
                    vertices = affine.apply_points(m, surface.positions)
                    if not _holds(vertices[surface.faces[:MEASURED]]):
                        raise NoCounterpartError(f"the shape {kind}, too small for float32")
                    volume = writing.volumes.inside(leaf, vertices, shader)
                    name = _material(leaf, volume, writing)
                    _note_place(leaf.shape, writing.named[name], vertices, writing)
                    one: Data = {"material": name}
                    if copy.instance < 0 or affine.mirrors(m):
                        triangles += len(surface.faces)
                        one["file"] = writing.save(**placed_arrays(surface, m))
                    else:
                        if key not in shared:
                            triangles += len(surface.faces)
                            shared[key] = writing.save(**placed_arrays(surface, affine.IDENTITY))
                        one |= {"file": shared[key], "matrix": m.tolist()}
                    found.append(one)
                if triangles > MOST_TRIANGLES:
                    writing.reasons.append(f"more than {MOST_TRIANGLES:,} triangles")
                    return found
    return found


def _note_place(shape: Any, material: Data, vertices: FloatArray, writing: Writing) -> None:
    box = np.stack([vertices.min(axis=0), vertices.max(axis=0)])
    writing.reach = max(writing.reach, float(np.abs(box).max()))
    if material["sampling"] == "FRONT":
        writing.lamps.append(box)
    if "'glass'" in str(material["shader"]):
        if not shapes.type_of(shape).encloses(shape):
            raise NoCounterpartError(
                f"glass on the shape {type_name(shape)}, which may not be closed"
            )
        writing.glass.append(box)


def _check_places(writing: Writing) -> None:
    """Cycles does not divide radiance by the square of the index behind glass: that cancels
    where the camera and all lights are outside.  A view that is much smaller than the scene is too
    coarse in float32."""
    camera = writing.scene.camera
    places = ((type_of_light(light).at, light) for light in writing.scene.lights)
    points = [np.array([at(light)] * 2) for at, light in places if at is not None]
    for box in (np.array([camera.eye] * 2), *points, *writing.lamps):
        for glass in writing.glass:
            if np.all(box[0] <= glass[1]) and np.all(glass[0] <= box[1]):
                raise NoCounterpartError("a camera or a lamp in glass")
    if math.dist(camera.eye, camera.target) < VIEW * writing.reach:
        raise NoCounterpartError("a view of less than a thousandth of the scene")


VIEW = 1e-3
"""Least distance of the target over the scene's size: float32 holds the view to 1e-4 then."""


def _material(leaf: Leaf, volume: list[Data] | None, writing: Writing) -> str:
    """The name, in what is written, of a shape's material and its volume."""
    name = leaf.material
    key = "" if name is None else name
    if volume is not None:
        key = f"{key}\n{leaf.interior}"
    if key not in writing.named:
        material = None if name is None else writing.scene.materials[name]
        sampling = "FRONT" if isinstance(material, Emissive) else "NONE"
        shader = writing.shader_of(name)
        writing.named[key] = {"sampling": sampling, "shader": shader, "volume": volume}
    return key


MEASURED = 10_000
"""Most triangles of a shape of which it is measured whether float32 holds them."""


def _holds(corners: FloatArray) -> bool:
    """Whether float32 moves the corners of triangles by at most a hundredth of the shortest edge's
    usual length (the median), as in `translator.moved`."""
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).min(axis=1)
    moved = np.abs(round32(corners) - corners).max()
    return bool(moved <= SHARE * np.median(edges))


def _has_texture(value: Any) -> bool:
    if isinstance(value, dict):
        return "uv" in value or any(map(_has_texture, value.values()))
    return isinstance(value, list) and any(map(_has_texture, value))

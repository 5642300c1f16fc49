"""Scene -> a scene file of pbrt-v4, .pbrt, with its meshes and images in a folder beside it.

`surfaces` has the format's words, and names of materials and textures, which have their own files
(`comparisons.materials`, `comparisons.textures`).

Contract: pbrt is given what the scene describes, in world coordinates, in linear sRGB.  Where pbrt
computes almost the same, notes say so; what it cannot express raises SceneError with all reasons.
pbrt itself is not needed, and nothing here was ever run by it: the tests check the grammar, and
evaluate what is written.

To write another light or shape: a case here; the tables of the tests say what pbrt accepts.
"""

import math
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import map_coordinates

from comparisons.geometry import affine
from comparisons.geometry.flatten import Leaf, Member, copies_of
from comparisons.mitsuba.files import Files, UnwritableError, check_name, ply, write_files
from comparisons.pbrt.surfaces import Writing, words
from comparisons.renderers.vocabulary import Params
from comparisons.shapes import type_of
from comparisons.shapes.shape import PbrtPart, PbrtPlace
from comparisons.translator.resolved import Tessellated, placed, tessellated
from reference_rt import lights
from reference_rt.cameras import Orthographic, Pinhole, ThinLens, film
from reference_rt.cameras.view_rectangle import by_width
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import Direct
from reference_rt.integrators import Path as PathTracing
from reference_rt.lights.emitters.environment_map import orthogonal
from reference_rt.materials import Emissive
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Independent, Sobol
from reference_rt.shapes import Plane, Shape
from reference_rt.textures.image_file import read_image

ENDLESS = 2**31 - 1
"""Depth of paths without a limit: the largest number that pbrt reads."""


def camera_of(camera: Any, picture: film.Film) -> list[str]:
    """pbrt's camera looks along +z of a left-handed space: x is mirrored; y of a pinhole's picture,
    which is upside down.  With an angle of 90 degrees the screen window is at distance 1."""
    if camera.near or camera.far:
        raise UnwritableError("clipping planes")
    mirror = (1, -1, 1) if isinstance(camera, Pinhole) else (-1, 1, 1)
    if isinstance(camera, Pinhole):
        width = camera.film_width / camera.film_distance
        params: Params = {"float screenwindow": by_width(width, picture.width, picture.height)}
    else:
        params = {"float screenwindow": camera.rectangle(picture.width, picture.height)}
    plugin = "orthographic" if isinstance(camera, Orthographic) else "perspective"
    if plugin == "perspective":
        params["float fov"] = 90.0
    if isinstance(camera, ThinLens):
        params["float lensradius"] = camera.aperture_radius
        params["float focaldistance"] = camera.focus
    place = words("LookAt", numbers=(*camera.eye, *camera.target, *camera.up))
    return [words("Scale", numbers=mirror), place, words("Camera", plugin, params=params)]


def film_of(picture: film.Film, name: str) -> list[str]:
    """The film's values are linear radiance: an exposure of 1 s at ISO 100 makes the sensor's
    factor 1, and the observer of 1931 is not balanced to another white."""
    match picture.filter:
        case film.TentFilter(radius=r):
            plugin, r, more = "triangle", r, Params()
        case film.GaussianFilter(stddev=s):
            plugin, r, more = "gaussian", 4.0 * s, {"float sigma": s}
        case film.MitchellFilter(b=b, c=c):
            plugin, r, more = "mitchell", 2.0, {"float B": b, "float C": c}
        case film.CatmullRomFilter():
            plugin, r, more = "mitchell", 2.0, {"float B": 0.0, "float C": 0.5}
        case film.LanczosFilter(lobes=n):
            plugin, r, more = "sinc", float(n), {"float tau": float(n)}
        case _:
            plugin, r, more = "box", 0.5, {}
    sensor = {"string sensor": "cie1931", "float iso": 100.0, "bool savefp16": False}
    size = {"integer xresolution": picture.width, "integer yresolution": picture.height}
    return [
        words("PixelFilter", plugin, params={"float xradius": r, "float yradius": r, **more}),
        words("Film", "rgb", params={"string filename": name, **size, **sensor}),
    ]


def sampler_of(sampler: Any) -> str:
    if not isinstance(sampler, Sobol | Independent):
        raise UnwritableError(f"light without random numbers, on a '{sampler.type}'")
    values = {"integer pixelsamples": sampler.spp, "integer seed": sampler.seed % 2**31}
    return words("Sampler", sampler.type, params=values)


def integrator_of(integrator: Any) -> str:
    """pbrt counts the surfaces between the camera and a light, we the edges."""
    if getattr(integrator, "hide_emitters", False):
        raise UnwritableError("lamps that cameras do not see")
    match integrator:
        case Direct(shadows=False):
            raise UnwritableError("direct light without shadows")
        case Direct(light_samples=0) | Direct(bsdf_samples=0):
            raise UnwritableError("direct light by one strategy alone")
        case Direct():
            depth = 1
        case PathTracing(max_depth=edges):
            depth = ENDLESS if edges is None else edges - 1
        case _:
            raise UnwritableError(f"the integrator '{integrator.type}'")
    return words("Integrator", "path", params={"integer maxdepth": depth, "bool regularize": False})


# ---- lights --------------------------------------------------------------------------------------


def lights_of(writing: Writing) -> list[str]:
    """Those that are no shapes.  A colour of pbrt's is the light's value: pbrt divides by the
    brightness of its illuminant."""
    found = []
    for k, light in enumerate(writing.scene.lights):
        with writing.collected("lights", k):
            if not isinstance(light, lights.Ambient):  # nothing that is written uses it
                plugin, params = _light(light, k, writing)
                found.append(words("LightSource", plugin, params=params))
    return found


def _light(light: Any, number: int, writing: Writing) -> tuple[str, Params]:
    match light:
        case lights.Point():
            return "point", {"rgb I": light.intensity, "point3 from": light.position}
        case lights.Spot(texture=None) if light.beam_width == light.cutoff_angle:
            place = {"point3 from": light.origin, "point3 to": light.target}
            cone = {"float coneangle": light.cutoff_angle, "float conedeltaangle": 0.0}
            return "spot", {"rgb I": light.intensity, **place, **cone}
        case lights.Spot():
            raise UnwritableError(
                "a spot with a texture, or with a beam_width below its cutoff_angle: its falloff "
                "between them is linear in the angle"
            )
        case lights.Directional():
            place = {"point3 from": (0.0, 0.0, 0.0), "point3 to": light.direction}
            return "distant", {"rgb L": light.irradiance, **place}
        case lights.Constant():
            return "infinite", {"rgb L": light.radiance}
        case lights.EnvironmentMap():
            return "infinite", {"string filename": _environment(light, number, writing)}
    raise UnwritableError(f"a light '{light.type}'")


def _environment(light: lights.EnvironmentMap, number: int, writing: Writing) -> str:
    """The name of an image of all directions on pbrt's square, on which equal areas are equal
    solid angles (Clarberg 2008).  pbrt does not interpolate: ours is sampled again, finer."""
    path = writing.scene.folder / light.file
    read = partial(read_image, path, light.encoding, light.scale, light.layer)
    texels = writing.read(read, "lights", number)
    side = min(2048, 2 ** math.ceil(math.log2(max(256, 1.2 * texels.shape[1]))))
    turned = orthogonal(light.transform)
    total = np.zeros((side, side, 3))
    for offset in FOUR:
        v, u = (np.mgrid[:side, :side] + np.array(offset)[:, None, None]) / side
        total += radiance_of(texels, square_to_sphere(u, v) @ turned)
    writing.note(f"'{light.file}' is sampled again, as an equal-area map of {side} x {side} pixels")
    return writing.image("environment", total / len(FOUR))


FOUR = ((0.25, 0.25), (0.25, 0.75), (0.75, 0.25), (0.75, 0.75))
"""Points of a pixel whose mean it is."""


def square_to_sphere(u: FloatArray, v: FloatArray) -> FloatArray:
    """The direction (..., 3) of a point inside the unit square (PBR 4ed, 3.8.3)."""
    x, y = 2.0 * u - 1.0, 2.0 * v - 1.0
    inside = 1.0 - (np.abs(x) + np.abs(y))
    r = 1.0 - np.abs(inside)
    phi = ((np.abs(y) - np.abs(x)) / r + 1.0) * (math.pi / 4.0)
    across = r * np.sqrt(2.0 - r * r)
    z = np.copysign(1.0 - r * r, inside)
    return np.stack(
        [np.copysign(np.cos(phi), x) * across, np.copysign(np.sin(phi), y) * across, z], axis=-1
    )


def radiance_of(texels: FloatArray, d: FloatArray) -> FloatArray:
    """A map of ours in unit directions (..., 3) of its own space: bilinear between texels, as
    `EnvironmentMaps` says."""
    height, width = texels.shape[:2]
    across = np.arctan2(d[..., 0], -d[..., 2]) * (width / (2.0 * math.pi)) - 0.5
    down = np.arccos(np.clip(d[..., 1], -1.0, 1.0)) * ((height - 1) / math.pi)
    found = np.empty_like(d)
    for k in range(3):
        found[..., k] = map_coordinates(texels[..., k], [down, across], order=1, mode="grid-wrap")
    return found


INLINE = 32
"""Most triangles that stand in the scene file itself."""


def shapes_of(writing: Writing) -> list[str]:
    """The lines of all shapes.  A group is written once, without its lamps: pbrt has none in
    instances, and so each copy's is written."""
    made: dict[int, Tessellated] = {}
    groups: dict[str, str] = {}
    found: list[str] = []

    def member(one: Member, outer: affine.Affine, *path: str | int) -> list[str]:
        with writing.collected(*path):
            if one.tree is not None:
                raise UnwritableError("a solid (CSG)")
            (leaf,) = one.leaves
            return _leaf(writing, leaf, affine.compose(leaf.outer, outer), made, *path)
        return []

    for copy in copies_of(writing.scene):
        if copy.instance < 0:
            found += member(copy.members[0], copy.outer, "shapes", copy.shape)
            continue
        lamps = [one for one in copy.members if _is_lamp(writing, one)]
        if copy.group not in groups:
            others = (one for one in copy.members if not _is_lamp(writing, one))
            path = ("groups", copy.group)
            lines = [line for one in others for line in member(one, affine.IDENTITY, *path)]
            groups[copy.group] = writing.name_for(*path) if lines else ""
            if lines:
                found += [words("ObjectBegin", groups[copy.group]), *lines, "ObjectEnd"]
        if name := groups[copy.group]:
            found += _attributes(matrix(copy.outer), words("ObjectInstance", name))
        for one in lamps:
            found += member(one, copy.outer, "groups", copy.group)
    return found


def _is_lamp(writing: Writing, member: Member) -> bool:
    names = (leaf.material for leaf in member.leaves if leaf.material is not None)
    return any(isinstance(writing.scene.materials[name], Emissive) for name in names)


def matrix(m: affine.Affine) -> str:
    """`Transform` with a map (3, 4): pbrt reads the matrix by columns."""
    values = np.vstack([m, [0.0, 0.0, 0.0, 1.0]]).T.ravel().tolist()
    return f"Transform [ {' '.join(map(repr, values))} ]"


def _attributes(*lines: str) -> list[str]:
    return ["AttributeBegin", *("  " + line for line in lines), "AttributeEnd"]


def _leaf(
    writing: Writing,
    leaf: Leaf,
    outer: affine.Affine,
    made: dict[int, Tessellated],
    *path: str | int,
) -> list[str]:
    name, radiance = writing.surface(leaf.material)
    head = [words("NamedMaterial", name)]
    if radiance is not None:
        front = {"rgb L": radiance, "bool twosided": False}
        head.append(words("AreaLightSource", "diffuse", params=front))
    m = affine.compose(affine.of_steps(leaf.shape.transform), outer)
    parts = native(leaf.shape, m, name in writing.oriented, radiance is not None)
    if not parts:
        return _attributes(*head, _mesh(writing, leaf.shape, outer, name, made, *path))
    lines = []
    for part in parts:
        turned = ["ReverseOrientation"] if part.reversed else []
        shape = words("Shape", part.plugin, params=part.params)
        lines += _attributes(*head, matrix(part.place), *turned, shape)
    return lines


def native(shape: Shape, m: affine.Affine, textured: bool, emits: bool) -> list[PbrtPart]:
    """pbrt's own shapes for one under the map m; none if triangles must stand for it: pbrt samples
    a lamp as if its transform kept lengths, and its disks have other texture coordinates."""
    is_similar = affine.is_similarity(m[:, :3])
    if emits and (textured or not is_similar):
        return []
    size = float(abs(np.linalg.det(m[:, :3]))) ** (1.0 / 3.0) if is_similar else 1.0
    m = np.column_stack([m[:, :3] / size, m[:, 3]])
    to_pbrt = type_of(shape).to_pbrt
    if to_pbrt is None:
        return []
    return to_pbrt(shape, PbrtPlace(m, size, affine.mirrors(m), textured))


def _mesh(
    writing: Writing,
    shape: Shape,
    outer: affine.Affine,
    material: str,
    made: dict[int, Tessellated],
    *path: str | int,
) -> str:
    """A shape as triangles in the coordinates of its group, or the world's."""
    kind = type(shape).__name__.lower()
    if isinstance(shape, Plane):
        raise UnwritableError("an infinite plane")
    if id(shape) not in made:
        read = partial(tessellated, shape, writing.scene.folder)
        made[id(shape)] = writing.read(read, *path)
    mesh, distance = made[id(shape)]
    if mesh.uv is None and material in writing.oriented:
        raise UnwritableError("a mesh without texture coordinates under a texture")
    if distance > 0.0:
        writing.note(f"a shape '{kind}' is written as triangles, up to {distance:.1g} off it")
    mesh = replace(placed(mesh, outer), colours=None)
    if len(mesh.faces) > INLINE:
        file = writing.files.write("mesh.ply", lambda path: path.write_bytes(ply(mesh)))
        return words("Shape", "plymesh", params={"string filename": file})
    columns = {"point3 P": mesh.vertices, "normal N": mesh.normals, "point2 uv": mesh.uv}
    arrays = {key: a.ravel().tolist() for key, a in columns.items() if a is not None}
    indices = {"integer indices": mesh.faces.ravel().tolist()}
    return words("Shape", "trianglemesh", params={**indices, **arrays})


def write_pbrt(scene: Scene, path: Path) -> tuple[int, list[str]]:
    """Write a scene as .pbrt, whole or not at all; how many files it has besides, and notes on what
    is not quite the same.

    Raises SceneError with all reasons why pbrt cannot express it; UsageError, ImageError.
    """
    check_name(path, (".pbrt",))
    notes: list[str] = []

    def text(files: Files) -> str:
        writing = Writing(scene, files)
        head = ['Option "disabletexturefiltering" true']
        with writing.collected("camera"):
            head += camera_of(scene.camera, scene.film)
        with writing.collected("integrator"):
            head.append(integrator_of(scene.integrator))
            with writing.collected("sampler"):
                head.append(sampler_of(scene.resolved_sampler))
        head += film_of(scene.film, f"{path.stem}.exr")
        shapes, world = shapes_of(writing), lights_of(writing)
        if scene.film.layers:
            writing.note("the film's layers are left out")
        if writing.one_sided:
            behind = ", ".join(f"'{name}'" for name in sorted(writing.one_sided))
            writing.note(f"black from behind, and not so in pbrt: {behind}")
        writing.check()
        notes.extend(writing.notes)
        comments = [f"Written by reference-rt from the scene {scene.name}."]
        comments += [f"Note: {note}." for note in notes]
        lines = [f"# {' '.join(line.split())}" for line in comments]
        return "\n".join([*lines, *head, "WorldBegin", *world, *writing.lines, *shapes, ""])

    return write_files(scene, path, text), notes

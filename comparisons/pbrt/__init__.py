"""Scene -> a scene file of pbrt-v4, .pbrt, with its meshes and images in a folder beside it.

`surfaces` has the format's words, and names of materials and textures, which have their own files
(`comparisons.materials`, `comparisons.textures`).

Contract: pbrt is given what the scene describes, in world coordinates, in linear sRGB.  Where pbrt
computes almost the same, notes say so; what it cannot express raises SceneError with all reasons.
pbrt itself is not needed, and nothing here was ever run by it: the tests check the grammar, and
evaluate what is written.

To write another light or shape: a case here; the tables of the tests say what pbrt accepts.
"""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.cameras import type_of as type_of_camera
from comparisons.cameras.film import type_of as type_of_filter
from comparisons.geometry import affine
from comparisons.geometry.flatten import Leaf, Member, copies_of
from comparisons.integrators import type_of as type_of_integrator
from comparisons.lights import type_of as type_of_light
from comparisons.mitsuba.files import Files, UnwritableError, check_name, ply, write_files
from comparisons.pbrt.surfaces import Writing, words
from comparisons.renderers import NoCounterpartError
from comparisons.renderers.vocabulary import Params
from comparisons.shapes import type_of
from comparisons.shapes.shape import PbrtPart, PbrtPlace
from comparisons.translator import resolved
from comparisons.translator.resolved import Tessellated, placed, tessellated
from reference_rt.cameras.film import Film
from reference_rt.materials import Emissive
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Independent, Sobol
from reference_rt.shapes import Plane, Shape

ENDLESS = 2**31 - 1
"""Depth of paths without a limit: the largest number that pbrt reads."""


def camera_of(scene: Scene) -> list[str]:
    """pbrt's camera looks along +z of a left-handed space: x is mirrored; y of a pinhole's picture,
    which is upside down.  With an angle of 90 degrees the screen window is at distance 1."""
    camera, of = scene.camera, type_of_camera(scene.camera)
    if camera.near or camera.far:
        raise UnwritableError("clipping planes")
    mirror = (1, -1, 1) if of.is_upside_down else (-1, 1, 1)
    params: Params = {"float screenwindow": resolved.camera_of(scene)["view"]}
    if not of.is_parallel:
        params["float fov"] = 90.0
    if lens := of.lens(camera):
        if lens.focus < 0.0:
            raise UnwritableError("a pinhole whose hole has a size")
        params["float lensradius"], params["float focaldistance"] = lens.radius, lens.focus
    plugin = "orthographic" if of.is_parallel else "perspective"
    place = words("LookAt", numbers=(*camera.eye, *camera.target, *camera.up))
    return [words("Scale", numbers=mirror), place, words("Camera", plugin, params=params)]


def film_of(picture: Film, name: str) -> list[str]:
    """The film's values are linear radiance: an exposure of 1 s at ISO 100 makes the sensor's
    factor 1, and the observer of 1931 is not balanced to another white."""
    plugin, r, more = type_of_filter(picture.filter).to_pbrt(picture.filter)
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


def integrator_of(integrator: Any, has_media: bool = False) -> str:
    """pbrt counts the surfaces between the camera and a light, and where media scatter, we the
    edges."""
    if getattr(integrator, "hide_emitters", False):
        raise UnwritableError("lamps that cameras do not see")
    edges_of = type_of_integrator(integrator).edges
    if edges_of is None:
        raise UnwritableError(f"the integrator '{integrator.type}'")
    try:
        edges = edges_of(integrator)
    except NoCounterpartError as error:
        raise UnwritableError(str(error)) from None
    depth = ENDLESS if edges is None else edges - 1
    plugin = "volpath" if has_media else "path"
    return words("Integrator", plugin, params={"integer maxdepth": depth, "bool regularize": False})


# ---- lights --------------------------------------------------------------------------------------


def lights_of(writing: Writing) -> list[str]:
    """Those that are no shapes.  A colour of pbrt's is the light's value: pbrt divides by the
    brightness of its illuminant."""
    lines = []
    for k, light in enumerate(writing.scene.lights):
        with writing.collected("lights", k):
            to_pbrt = type_of_light(light).to_pbrt
            if to_pbrt is None:
                raise UnwritableError(f"a light '{light.type}'")
            written = to_pbrt(light, writing)
            if written is not None:
                lines.append(words("LightSource", written[0], params=written[1]))
    return lines


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
    head = [words("NamedMaterial", name), *writing.interface(leaf.interior, leaf.exterior)]
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
        around = scene.camera.medium
        with writing.collected("camera"):
            head += [*writing.interface(None, around), *camera_of(scene)]
        with writing.collected("integrator"):
            head.append(integrator_of(scene.integrator, scene.has_media))
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
        lines += writing.media  # before the camera, which may stand in one
        return "\n".join([*lines, *head, "WorldBegin", *world, *writing.lines, *shapes, ""])

    return write_files(scene, path, text), notes

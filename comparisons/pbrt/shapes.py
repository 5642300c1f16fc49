"""Shapes, and instances of groups, in the words of pbrt-v4's file format.

A sphere, a disk and a cylinder are pbrt's own, all others triangles.  pbrt turns a shape's normal
round where its transform mirrors space, and its samples of lights not: so no transform of a shape
here mirrors, but that of one with a texture, whose orientation is reversed.
"""

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.flatten import Leaf, Member, copies_of
from comparisons.mitsuba.writing.files import UnwritableError, ply
from comparisons.mitsuba.writing.resolved import Tessellated, placed, tessellated
from comparisons.pbrt.surfaces import Params, Writing, words
from reference_rt.materials import Emissive
from reference_rt.shapes import Cylinder, Disk, Plane, Shape, Sphere

INLINE = 32
"""Most triangles that stand in the scene file itself."""


class Part(NamedTuple):
    """A shape of pbrt's;  place: the map of its own coordinates to the world;  reversed: whether
    its normal is turned round."""

    place: affine.Affine
    plugin: str
    params: Params
    reversed: bool = False


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


def native(shape: Shape, m: affine.Affine, textured: bool, emits: bool) -> list[Part]:
    """pbrt's own shapes for one under the map m; none if triangles must stand for it: pbrt samples
    a lamp as if its transform kept lengths, and its disks have other texture coordinates."""
    is_similar = affine.is_similarity(m[:, :3])
    if emits and (textured or not is_similar):
        return []
    size = float(abs(np.linalg.det(m[:, :3]))) ** (1.0 / 3.0) if is_similar else 1.0
    m = np.column_stack([m[:, :3] / size, m[:, 3]])
    mirrored = affine.mirrors(m)
    match shape:
        case Sphere(center=center, radius=r):
            m = affine.compose(np.column_stack([np.eye(3), np.multiply(center, size)]), m)
            # Its texture coordinate v runs down, pbrt's up.
            turned = mirrored or textured
            place = m * [1.0, 1.0, -1.0, 1.0] if turned else m
            return [Part(place, "sphere", {"float radius": r * size}, turned and not mirrored)]
        case Disk() if not textured:
            place = m * [-1.0, 1.0, 1.0, 1.0] if mirrored else m
            return [Part(place, "disk", {"float radius": size})]
        case Cylinder(radius=r) if not (textured and shape.capped):
            low, high = shape.z_min * size, shape.z_max * size
            if mirrored and not textured:
                m, low, high = m * [1.0, 1.0, -1.0, 1.0], -high, -low
            params = {"float radius": r * size, "float zmin": low, "float zmax": high}
            parts = [Part(m, "cylinder", params, mirrored and textured)]
            if shape.capped:
                for place, z in ((m, high), (m * [1.0, -1.0, -1.0, 1.0], -low)):
                    cap = {"float radius": r * size, "float height": z}
                    parts.append(Part(place, "disk", cap))
            return parts
    return []


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

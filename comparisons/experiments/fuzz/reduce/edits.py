"""Smaller scenes out of a scene, by structure.  An edit may yield invalid scenes."""

from collections.abc import Callable, Iterator
from typing import Any

from comparisons.experiments.fuzz.data import Data, copy_of, named_in, shapes_of

Edit = Callable[[Data], Iterator[Data]]

_WRAPPED = {"base": "base", "first": "first", "second": "second", "back": "back"}
"""Fields of a material that name another one."""


def without_unused(scene: Data) -> Data:
    """The scene without materials, textures and groups that nothing names, and without empty
    sections."""
    found: Data = copy_of(scene)
    while True:
        before = copy_of(found)
        used = {s[k] for s in shapes_of(found) for k in ("material", "group") if s.get(k)}
        for light in found.get("lights", ()):
            used |= {at[key] for at, key in named_in(light)}
        for name, material in found.get("materials", {}).items():
            used |= {v for k, v in material.items() if isinstance(v, str) and k != "type"}
            used |= {name} if name in used else set()
        for section in ("materials", "textures", "groups"):
            table = {k: v for k, v in found.get(section, {}).items() if k in used}
            found.pop(section, None)
            if table:
                found[section] = table
        for section in ("shapes", "lights"):
            if not found.get(section, True):
                del found[section]
        if found == before:
            order = [key for key in scene if key in found]
            return {key: found[key] for key in order}


def _lists(scene: Data) -> Iterator[tuple[list[Any], int]]:
    """All lists of which parts may be left out, and how many must remain."""
    for section in ("shapes", "lights"):
        if section in scene:
            yield scene[section], 0
    for members in scene.get("groups", {}).values():
        yield members, 1
    for shape in shapes_of(scene):
        if "of" in shape:
            yield shape["of"], 1
        if "transform" in shape:
            yield shape["transform"], 0
        if "faces" in shape:
            yield shape["faces"], 1
        if "rings" in shape:
            yield shape["rings"], 1


def fewer(scene: Data) -> Iterator[Data]:
    """Lists without half, a quarter, ..., one of their parts."""
    count = sum(1 for _ in _lists(scene))
    for which in range(count):
        size = len(_nth(scene, which)[0])
        least = _nth(scene, which)[1]
        step = max(1, size // 2)
        while size:
            for begin in range(0, size, step):
                smaller = copy_of(scene)
                part = _nth(smaller, which)[0]
                del part[begin : begin + step]
                if len(part) >= least:
                    yield smaller
            if step == 1:
                break
            step //= 2


def _nth(scene: Data, which: int) -> tuple[list[Any], int]:
    for k, found in enumerate(_lists(scene)):
        if k == which:
            return found
    raise IndexError(which)


def plain_sections(scene: Data) -> Iterator[Data]:
    """Sections that have a default, left out."""
    for key in ("description", "hierarchy", "sampler", "integrator"):
        if key in scene:
            yield {k: v for k, v in copy_of(scene).items() if k != key}
    for key in ("filter", "layers"):
        if key in scene.get("film", {}):
            smaller = copy_of(scene)
            del smaller["film"][key]
            yield smaller


def plain_shapes(scene: Data) -> Iterator[Data]:
    """An instance becomes the members of its group, a solid one of its operands, a shape a sphere
    or a rectangle; shapes lose their material."""
    for k, shape in enumerate(scene.get("shapes", ())):
        for others in _instead(shape, scene):
            smaller = copy_of(scene)
            smaller["shapes"][k : k + 1] = copy_of(others)
            yield smaller
    for which, shape in enumerate(shapes_of(scene)):
        if "material" in shape:
            smaller = copy_of(scene)
            del _shape(smaller, which)["material"]
            yield smaller


def _shape(scene: Data, which: int) -> Data:
    return [*shapes_of(scene)][which]


def _instead(shape: Data, scene: Data) -> Iterator[list[Data]]:
    steps = shape.get("transform", [])
    if shape["type"] == "instance":
        members = scene.get("groups", {}).get(shape["group"], [])
        yield [{**m, "transform": [*m.get("transform", []), *steps]} for m in members]
        return
    for operand in shape.get("of", ()):
        own = {"material": shape["material"]} if "material" in shape else {}
        yield [{**own, **operand, "transform": [*operand.get("transform", []), *steps]}]
    for kind in ("sphere", "rectangle"):
        if shape["type"] not in ("sphere", "rectangle"):
            kept: Data = {k: shape[k] for k in ("material", "transform") if k in shape}
            yield [{"type": kind, **kept}]


def plain_materials(scene: Data) -> Iterator[Data]:
    """A material that is made of others becomes one of them, a lamp only emits, others become
    diffuse; colours lose their textures."""
    for name, material in scene.get("materials", {}).items():
        for field in _WRAPPED:
            if material.get(field) is not None and material["type"] != "emissive":
                yield renamed(scene, name, material[field])
        if material["type"] == "emissive":
            continue
        if material["type"] != "diffuse":
            smaller = copy_of(scene)
            smaller["materials"][name] = {"type": "diffuse"}
            yield smaller


def renamed(scene: Data, old: str, new: str) -> Data:
    """`new` wherever `old` is named."""
    found = copy_of(scene)
    for shape in shapes_of(found):
        if shape.get("material") == old:
            shape["material"] = new
    for material in found["materials"].values():
        for field in _WRAPPED:
            if material.get(field) == old:
                material[field] = new
    del found["materials"][old]
    return without_unused(found)


def fewer_fields(scene: Data) -> Iterator[Data]:
    """Fields left out: of those that have a default the scene stays valid."""
    for path in [*_fields(scene, ())]:
        smaller = copy_of(scene)
        at = smaller
        for key in path[:-1]:
            at = at[key]
        del at[path[-1]]
        yield smaller


def _fields(part: Any, path: tuple[Any, ...]) -> Iterator[tuple[Any, ...]]:
    if isinstance(part, dict):
        for key, value in part.items():
            there = *path, key
            if path and key not in ("type", "of") and not (_is_named(path) or fixes_view(there)):
                yield there
            yield from _fields(value, (*path, key))
    elif isinstance(part, list) and path[-1] not in ("faces", "vertices", "rings"):
        for k, value in enumerate(part):
            yield from _fields(value, (*path, k))


def fixes_view(path: tuple[Any, ...]) -> bool:
    """Whether a number says where the camera is: its default may lie on a surface, and the scene
    would then fail for that reason."""
    return path[:2] in (("camera", "eye"), ("camera", "target"))


def _is_named(path: tuple[Any, ...]) -> bool:
    """Whether the path's keys are names, not fields."""
    return len(path) == 1 and path[0] in ("materials", "textures", "groups")


def fewer_vertices(scene: Data) -> Iterator[Data]:
    """Meshes without the vertices that no triangle has, and without numbers at vertices."""
    for which, shape in enumerate(shapes_of(scene)):
        faces, vertices = shape.get("faces"), shape.get("vertices")
        if not faces or not vertices:
            continue
        used = sorted({v for face in faces for v in face})
        if len(used) == len(vertices):
            continue
        number = {old: new for new, old in enumerate(used)}
        smaller = copy_of(scene)
        mesh = _shape(smaller, which)
        mesh["faces"] = [[number[v] for v in face] for face in faces]
        for field in ("vertices", "normals", "uv", "colours"):
            if field in mesh:
                mesh[field] = [mesh[field][v] for v in used]
        yield smaller


EDITS: tuple[Edit, ...] = (
    fewer,
    plain_sections,
    plain_shapes,
    plain_materials,
    fewer_vertices,
    fewer_fields,
)
"""In the order in which they are tried: what removes most comes first."""

"""A failing scene made small while it fails in the same rung with the same cause.

Edits yield smaller scenes; the loop keeps one that still fails, and starts over until none does.
Reduction is by structure (shapes, lights, materials, wrappers, steps of transforms, triangles),
then numbers, then the picture, as in C-Reduce (Regehr et al. 2012).
"""

import math
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from comparisons.experiments.fuzz.data import (
    NAMED,
    Data,
    Way,
    at,
    copy_of,
    named_in,
    numbers_in,
    shapes_of,
    text_of,
)

# ---- structure: an edit may yield invalid scenes ------------------------------------------------


Edit = Callable[[Data], Iterator[Data]]

_WRAPPED = {"base": "base", "first": "first", "second": "second", "back": "back"}
"""Fields of a material that name another one."""


def without_unused(scene: Data) -> Data:
    """The scene without materials, textures, media and groups that nothing names, and without
    empty sections."""
    found: Data = copy_of(scene)
    while True:
        before = copy_of(found)
        named = ("material", "group", "interior", "exterior")
        used = {s[k] for s in shapes_of(found) for k in named if s.get(k)}
        used.add(found.get("camera", {}).get("medium"))
        for light in found.get("lights", ()):
            used |= {at[key] for at, key in named_in(light)}
        for name, material in found.get("materials", {}).items():
            used |= {v for k, v in material.items() if isinstance(v, str) and k != "type"}
            used |= {name} if name in used else set()
        for name, texture in found.get("textures", {}).items():
            used |= {*texture.get("of", ())} if name in used else set()
        for section in NAMED:
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
        del at(smaller, path[:-1])[path[-1]]
        yield smaller


def _fields(part: Any, path: Way) -> Iterator[Way]:
    if isinstance(part, dict):
        for key, value in part.items():
            there = *path, key
            if path and key not in ("type", "of") and not (_is_named(path) or fixes_view(there)):
                yield there
            yield from _fields(value, (*path, key))
    elif isinstance(part, list) and path[-1] not in ("faces", "vertices", "rings"):
        for k, value in enumerate(part):
            yield from _fields(value, (*path, k))


def fixes_view(path: Way) -> bool:
    """Whether a number says where the camera is: its default may lie on a surface, and the scene
    would then fail for that reason."""
    return path[:2] in (("camera", "eye"), ("camera", "target"))


def _is_named(path: Way) -> bool:
    """Whether the path's keys are names, not fields."""
    return len(path) == 1 and path[0] in NAMED


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
        for field in ("vertices", "normals", "uv", "more_uv", "colours"):
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


# ---- numbers and pictures -----------------------------------------------------------------------


_FIXED = frozenset(("faces", "seed", "spp", "width", "height"))


def simpler_numbers(scene: Data) -> Iterator[Data]:
    """Each number as 0, 1, a whole number, or one of fewer digits."""
    for path in [*numbers_in(scene, but=_FIXED)]:
        value = at(scene, path)
        for other in simpler(float(value), digits_only=fixes_view(path)):
            smaller = copy_of(scene)
            at(smaller, path[:-1])[path[-1]] = other
            yield smaller


def simpler(x: float, digits_only: bool = False) -> list[float]:
    """Numbers to try in place of x, the simplest first; none as long as x itself.  digits_only:
    only those near x."""
    size = len(_short(x))
    found = [] if digits_only else [0.0, 1.0, -1.0]
    found.append(float(round(x)))
    if x != 0.0 and math.isfinite(x):
        found += [float(f"{x:.1g}"), float(f"{x:.2g}")]
    kept = [y for y in dict.fromkeys(found) if y != x and len(_short(y)) < size]
    if x == -1.0:
        kept = [] if digits_only else [1.0, 0.0]
    return [] if x in (0.0, 1.0) else kept


def _short(x: float) -> str:
    return repr(x).replace("-", "").removesuffix(".0")


def smaller_pictures(scene: Data) -> Iterator[Data]:
    """Half as wide, half as high, both."""
    film = scene.get("film", {})
    width, height = film.get("width", 256), film.get("height", 256)
    for w, h in ((width // 2, height // 2), (width // 2, height), (width, height // 2)):
        if w >= 3 and h >= 3 and (w, h) != (width, height):
            smaller = copy_of(scene)
            smaller["film"] = {**film, "width": w, "height": h}
            yield smaller


# ---- the loop -----------------------------------------------------------------------------------


Fails = Callable[[Data], bool]
"""Whether a scene fails in the same rung with the same cause."""

_EDITS: tuple[Edit, ...] = (*EDITS, smaller_pictures, simpler_numbers)


class Found(NamedTuple):
    """scene: the smallest that fails;  tried: scenes that were checked;  done: whether no
    edit makes it smaller, not only time or tries were used up."""

    scene: Data
    tried: int
    done: bool


def reduce(
    scene: Data,
    fails: Fails,
    *,
    most: int = 600,
    seconds: float = 120.0,
    clock: Callable[[], float] = time.monotonic,
) -> Found:
    """The smallest scene that is found with at most `most` tries and in about `seconds`."""
    end, tried = clock() + seconds, 0
    seen = {text_of(scene)}

    def still(candidate: Data) -> bool:
        nonlocal tried
        text = text_of(candidate)
        if text in seen:
            return False
        seen.add(text)
        tried += 1
        return fails(candidate)

    def enough() -> bool:
        return tried >= most or clock() > end

    tidy = without_unused(scene)
    if still(tidy):
        scene = tidy
    while True:
        before = text_of(scene)
        for edit in _EDITS:
            scene = _with_edit(scene, edit, still, enough)
        if enough():
            return Found(scene, tried, False)
        if text_of(scene) == before:
            return Found(scene, tried, True)


def _with_edit(
    scene: Data, edit: Edit, still: Callable[[Data], bool], enough: Callable[[], bool]
) -> Data:
    """The scene after all steps of an edit that leave it failing.  After a success the edit goes on
    at the same place of the smaller scene: what failed to go before rarely goes now."""
    place = 0
    while not enough():
        found = None
        for k, candidate in enumerate(_from(edit(scene), place)):
            if enough():
                return scene
            candidate = without_unused(candidate)
            if still(candidate):
                found, place = candidate, place + k
                break
        if found is None:
            return scene
        scene = found
    return scene


def _from(candidates: Iterator[Data], place: int) -> Iterator[Data]:
    for k, candidate in enumerate(candidates):
        if k >= place:
            yield candidate

"""Identities that hold to the last bit."""

import json
from typing import Any

import numpy as np

from comparisons.experiments.fuzz.finding import Data, Finding, named_in, shapes_of
from comparisons.experiments.fuzz.identities.rays import Bench, Original, ray_words, words
from comparisons.geometry.frame import Frame
from comparisons.mitsuba.translate.moved import moved
from comparisons.rungs.rays.rays import pixel_rays
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import RayCast, Whitted
from reference_rt.rendering import query
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import SceneError

HIERARCHIES = ("none", "sah", "median", "spatial")


def _data(scene: Scene) -> Data:
    found: Data = json.loads(scene.to_json())
    return found


def _again(scene: Scene, data: Data) -> Scene:
    return Scene.parse(json.dumps(data), "other.json", scene.folder)


def written(original: Original) -> str | Finding:
    """Written as YAML or JSON and read again, the scene is the same."""
    scene = original.scene
    for what, text in (("YAML", scene.to_yaml()), ("JSON", scene.to_json())):
        again = Scene.parse(text, "again", scene.folder)
        if again != scene or again.digest() != scene.digest():
            return Finding(
                rung="identity written", cause=f"{what} is another scene", detail=text[:300]
            )
    return "agree"


def renamed(original: Original) -> str | Finding:
    """Other names for materials, textures and groups, defined in another order."""
    data = _data(original.scene)
    for section in ("materials", "textures", "groups"):
        table = data.get(section, {})
        data[section] = {f"z{name}": table[name] for name in reversed(table)}
    names = {*data["materials"], *data["textures"]}
    for part in (*data["materials"].values(), *data.get("lights", ())):
        for at, key in [*named_in(part)]:
            if f"z{at[key]}" in names:
                at[key] = f"z{at[key]}"
    for shape in shapes_of(data):
        for field in ("material", "group"):
            if shape.get(field) is not None:
                shape[field] = f"z{shape[field]}"
    return _same_picture("renamed", original, _again(original.scene, data))


def threads(original: Original) -> str | Finding:
    """Two threads in place of one."""
    return _same_picture("threads", original, original.scene, 2)


def hierarchy(original: Original) -> str | Finding:
    """Other acceleration structures, two of all: rays, and the picture for one of them."""
    at = original.bench
    for kind in original.rng.permutation(HIERARCHIES)[:2].tolist():
        other = original.scene.changed(hierarchy=kind)
        hits = query.intersect(other.tables, at.o, at.d)
        bad = _unequal(at.hits, hits)
        if len(bad):
            return _of_rays(f"hierarchy {kind}", "hierarchy", at, hits, bad)
    return _same_picture("hierarchy", original, other)


def reordered(original: Original) -> str | Finding | None:
    """Shapes in another order."""
    scene, at = original.scene, original.bench
    count = len(scene.shapes)
    if count < 2:
        return None
    order = original.rng.permutation(count)
    other = scene.changed(shapes=tuple(scene.shapes[k] for k in order))
    hits = query.intersect(other.tables, at.o, at.d)
    old = np.append(order, -1)[hits.shape]
    differs = _unlike(hits.t, at.hits.t)
    for k in np.flatnonzero(~differs & (old != at.hits.shape)).tolist():
        differs[k] = not _is_tie(scene, at, k, int(old[k]))
    bad = np.flatnonzero(differs)
    if len(bad):
        return _of_rays("another order", "reordered", at, hits, bad)
    return "agree"


def _is_tie(scene: Scene, at: Bench, k: int, other: int) -> bool:
    """Whether both shapes are met at the same t: either may be said to be the first."""
    if other < 0 or at.hits.shape[k] < 0:
        return False
    alone = scene.changed(shapes=(scene.shapes[other],))
    found = query.intersect(alone.tables, at.o[k : k + 1], at.d[k : k + 1])
    return bool(found.t[0] == at.hits.t[k])


def split(original: Original) -> str | Finding | None:
    """Meshes in two halves."""
    data = _data(original.scene)
    found = False
    shapes: list[Any] = []
    for shape in data.get("shapes", ()):
        faces = shape.get("faces") or ()
        if shape["type"] != "mesh" or len(faces) < 2:
            shapes.append(shape)
            continue
        found = True
        half = len(faces) // 2
        shapes += [shape | {"faces": faces[:half]}, shape | {"faces": faces[half:]}]
    if not found:
        return None
    try:
        other = _again(original.scene, data | {"shapes": shapes})
        tables = other.tables
    except SceneError:  # a half without any area
        return None
    at = original.bench
    hits = query.intersect(tables, at.o, at.d)
    bad = np.flatnonzero(_unlike(hits.t, at.hits.t))
    return _of_rays("split meshes", "split", at, hits, bad) if len(bad) else "agree"


def scaled(original: Original) -> str | Finding:
    """All lengths times a power of two: the same t along rays scaled likewise, and the same light
    of Whitted ray tracing."""
    scene, at = original.scene, original.bench
    factor = 2.0 ** int(original.rng.integers(-6, 7))
    other = moved(scene, Frame((0.0, 0.0, 0.0), factor))
    hits = query.intersect(other.tables, factor * at.o, factor * at.d)
    bad = _unequal(at.hits, hits)
    if len(bad):
        return _of_rays(f"times {factor:g}", "scaled", at, hits, bad)
    if isinstance(scene.integrator, RayCast) or scene.tables.lights.choice is None:
        return "agree"
    rays = pixel_rays(scene, Frame(), 64)
    setup = Whitted(max_depth=4).setup()
    first = query.radiance_without_noise(scene.tables, setup, rays.o, rays.d)
    second = query.radiance_without_noise(other.tables, setup, factor * rays.o, rays.d)
    wrong = np.flatnonzero(_unlike(first, second).any(axis=1))
    if len(wrong) == 0:
        return "agree"
    k = int(wrong[0])
    return Finding(
        rung="identity scaled",
        cause="light",
        detail=f"times {factor:g}: {len(wrong)} of {len(rays.o)} pixels differ; the first, of the "
        f"ray from {rays.o[k].tolist()} along {rays.d[k].tolist()}: {first[k].tolist()}, "
        f"then {second[k].tolist()}",
    )


# ---- equality -----------------------------------------------------------------------------------


def _unlike(a: FloatArray, b: FloatArray) -> Any:
    """Where numbers differ; NaN equals NaN."""
    return ~((a == b) | (np.isnan(a) & np.isnan(b)))


def _unequal(a: Intersections, b: Intersections) -> Any:
    """Rays that do not hit the same thing at the same t."""
    differs = _unlike(a.t, b.t) | (a.shape != b.shape) | (a.part != b.part)
    return np.flatnonzero(differs | (a.primitive != b.primitive) | (a.instance != b.instance))


def _of_rays(how: str, identity: str, at: Bench, hits: Intersections, bad: Any) -> Finding:
    k = int(bad[0])
    cause = "a hit and a miss" if (hits.shape[k] < 0) != (at.hits.shape[k] < 0) else "hits differ"
    return Finding(
        rung=f"identity {identity}",
        cause=cause,
        detail=f"{how}: {len(bad)} of {len(at.o)} rays differ; the first, {ray_words(at, k)}: "
        f"{words(at.hits, k)}; then {words(hits, k)}",
    )


def _same_picture(name: str, original: Original, other: Scene, count: int = 1) -> str | Finding:
    first, second = original.picture, render(other, threads=count, tables=other.tables)
    for layer, values in first.layers.items():
        wrong = np.argwhere(_unlike(values, second.layers[layer]))
        if len(wrong):
            where = tuple(wrong[0].tolist())
            return Finding(
                rung=f"identity {name}",
                cause=f"the picture's {layer}",
                detail=f"{len(wrong)} of {values.size} numbers differ; the first in row "
                f"{where[0]}, column {where[1]}: {values[where]!r}, then "
                f"{second.layers[layer][where]!r}",
            )
    return "agree"

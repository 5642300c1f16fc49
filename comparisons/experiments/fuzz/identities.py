"""Changes of a scene that must not change what is seen: no second renderer is needed.

An identity is a function of the `Original` scene.  It returns "agree", None if it does not apply,
or the `Finding`.  What changes in the scene is in `comparisons.experiments.relations`.  To add one:
a function with the decorator `identity`.
"""

import dataclasses
import itertools
import json
from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from comparisons.experiments import relations
from comparisons.experiments.fuzz.data import NAMED, Data, named_in, shapes_of
from comparisons.experiments.fuzz.finding import Finding
from comparisons.experiments.relations import HIERARCHIES, REACH, Motion, differ, identities_of
from comparisons.geometry.frame import Frame
from comparisons.referee.sizes import ShapeSizes
from comparisons.rungs.rays.rays import pixel_rays
from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import UNIT_ROUNDOFF
from reference_rt.integrators import RayCast, Whitted
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering import query
from reference_rt.rendering.picture import Picture
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Plane
from reference_rt.shapes.instances import Instance
from reference_rt.shapes.shape import Solid
from reference_rt.util.errors import SceneError

# ---- the scene before it is changed -------------------------------------------------------------


class Bench(NamedTuple):
    """A scene's rays o, d (n, 3), of which some start on surfaces, and their first hits;  size: of
    the largest coordinate that matters."""

    tables: SceneTables
    o: FloatArray
    d: FloatArray
    hits: Intersections
    size: float


def bench(scene: Scene, rng: np.random.Generator, n: int) -> Bench:
    """A third from the eye, a third between random points, a third from where those hit."""
    tables = scene.tables
    sizes = ShapeSizes(scene)
    eye = np.array(scene.camera.eye)
    finite = np.isfinite(sizes.lower) & np.isfinite(sizes.upper)
    lower = np.where(finite, np.minimum(sizes.lower, eye), eye - 1.0)
    upper = np.where(finite, np.maximum(sizes.upper, eye), eye + 1.0)
    few = n // 3
    target = rng.uniform(lower, upper, (few, 3))
    o = np.concatenate([np.tile(eye, (few, 1)), rng.uniform(lower, upper, (few, 3))])
    d = np.concatenate([target - eye, rng.uniform(lower, upper, (few, 3)) - o[few:]])
    first = query.intersect(tables, o, d)
    met = np.flatnonzero(first.shape >= 0)[:few]
    o = np.concatenate([o, first.p[met] + 1e-3 * (upper - lower).max() * first.n[met]])
    d = np.concatenate([d, rng.normal(size=(len(met), 3))])
    kept = np.any(d != 0.0, axis=1)
    o, d = o[kept], d[kept]
    size = float(np.abs([lower, upper]).max())
    return Bench(tables, o, d, query.intersect(tables, o, d), size)


class Original:
    """The scene before it is changed;  rng: draws the changes and the rays;  rays: how many.  The
    picture and the hits of rays are computed once for all identities."""

    def __init__(self, scene: Scene, rng: np.random.Generator, rays: int) -> None:
        self.scene, self.rng, self.rays = scene, rng, rays

    @cached_property
    def picture(self) -> Picture:
        return render(self.scene, threads=1, tables=self.scene.tables)

    @cached_property
    def bench(self) -> Bench:
        return bench(self.scene, self.rng, self.rays)


Identity = Callable[[Original], str | Finding | None]

IDENTITIES: dict[str, Identity] = {}
"""By name, in the order in which a scene is put through them."""


def identity(check: Identity) -> Identity:
    """Register a function as the identity of its name."""
    IDENTITIES[check.__name__] = check
    return check


def words(hits: Intersections, k: int) -> str:
    """A hit, for people."""
    if hits.shape[k] < 0:
        return "nothing"
    return (
        f"shape {hits.shape[k]}, part {hits.part[k]}, primitive {hits.primitive[k]}, "
        f"t = {float(hits.t[k])!r}, n = {hits.n[k].tolist()}"
    )


def ray_words(at: Bench, k: int) -> str:
    """A ray, for people."""
    return f"the ray from {at.o[k].tolist()} along {at.d[k].tolist()}"


# ---- identities that hold to the last bit -------------------------------------------------------


def _data(scene: Scene) -> Data:
    found: Data = json.loads(scene.to_json())
    return found


def _again(scene: Scene, data: Data) -> Scene:
    return Scene.parse(json.dumps(data), "other.json", scene.folder)


@identity
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


@identity
def renamed(original: Original) -> str | Finding:
    """Other names for materials, textures, media and groups, defined in another order."""
    data = _data(original.scene)
    for section in NAMED:
        table = data.get(section, {})
        data[section] = {f"z{name}": table[name] for name in reversed(table)}
    names = {*data["materials"], *data["textures"]}
    for part in (*data["materials"].values(), *data.get("lights", ())):
        for at, key in [*named_in(part)]:
            if f"z{at[key]}" in names:
                at[key] = f"z{at[key]}"
    for texture in data["textures"].values():
        if "of" in texture:
            texture["of"] = [f"z{name}" for name in texture["of"]]
    for shape in shapes_of(data):
        for field in ("material", "group", "interior", "exterior"):
            if shape.get(field) is not None:
                shape[field] = f"z{shape[field]}"
    if data["camera"].get("medium") is not None:
        data["camera"]["medium"] = f"z{data['camera']['medium']}"
    return _same_picture("renamed", original, _again(original.scene, data))


@identity
def threads(original: Original) -> str | Finding:
    """Two threads in place of one."""
    return _same_picture("threads", original, original.scene, 2)


@identity
def hierarchy(original: Original) -> str | Finding:
    """Other acceleration structures, two of all: rays, and the picture for one of them."""
    at = original.bench
    for kind in original.rng.permutation(HIERARCHIES)[:2].tolist():
        other = original.scene.changed(hierarchy=kind)
        hits = query.intersect(other.tables, at.o, at.d)
        found = _of_rays(f"hierarchy {kind}", "hierarchy", at, hits, _unequal(at.hits, hits))
        if found != "agree":
            return found
    return _same_picture("hierarchy", original, other)


@identity
def reordered(original: Original) -> str | Finding | None:
    """Shapes in another order."""
    scene, at = original.scene, original.bench
    count = len(scene.shapes)
    if count < 2:
        return None
    other, names = relations.reordered(scene, original.rng.permutation(count))
    hits = query.intersect(other.tables, at.o, at.d)
    old = names(identities_of(hits))[:, 0]
    differs = _unlike(hits.t, at.hits.t)
    for k in np.flatnonzero(~differs & (old != at.hits.shape)).tolist():
        differs[k] = not _is_tie(scene, at, k, int(old[k]))
    return _of_rays("another order", "reordered", at, hits, np.flatnonzero(differs))


def _is_tie(scene: Scene, at: Bench, k: int, other: int) -> bool:
    """Whether both shapes are met at the same t: either may be said to be the first."""
    if other < 0 or at.hits.shape[k] < 0:
        return False
    alone = scene.changed(shapes=(scene.shapes[other],))
    found = query.intersect(alone.tables, at.o[k : k + 1], at.d[k : k + 1])
    return bool(found.t[0] == at.hits.t[k])


@identity
def split(original: Original) -> str | Finding | None:
    """Meshes in two halves."""

    def halves(count: int) -> list[Any]:
        numbers = np.arange(count)
        return [numbers] if count < 2 else [numbers[: count // 2], numbers[count // 2 :]]

    try:
        changed = relations.remeshed(original.scene, halves)
        tables = None if changed is None else changed[0].tables
    except (SceneError, ValueError):  # a half without any area
        return None
    if tables is None:
        return None
    at = original.bench
    hits = query.intersect(tables, at.o, at.d)
    bad = np.flatnonzero(_unlike(hits.t, at.hits.t))
    return _of_rays("split meshes", "split", at, hits, bad)


@identity
def scaled(original: Original) -> str | Finding:
    """All lengths times a power of two: the same t along rays scaled likewise, and the same light
    of Whitted ray tracing."""
    scene, at = original.scene, original.bench
    factor = 2.0 ** int(original.rng.integers(-6, 7))
    other = relations.moved(scene, Motion(factor))
    hits = query.intersect(other.tables, factor * at.o, factor * at.d)
    found = _of_rays(f"times {factor:g}", "scaled", at, hits, _unequal(at.hits, hits))
    if found != "agree":
        return found
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
    return np.flatnonzero(_unlike(a.t, b.t) | differ(identities_of(a), identities_of(b)))


def _of_rays(how: str, identity: str, at: Bench, hits: Intersections, bad: Any) -> str | Finding:
    if len(bad) == 0:
        return "agree"
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


# ---- identities that hold up to rounding --------------------------------------------------------


SPREAD = 4.0
"""How many times as much as under such a move a hit may change: the move is that of one point, and
a hit depends on the positions of three or four."""

AROUND = np.array([v for v in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(v)], np.float64)
"""Directions of the moves: to the faces, edges and corners of a cube."""

NORMAL = 1e-6
"""Allowed change of a unit normal besides that: roundings of 1e-13 of the size over the radii of
curvature of ordinary scenes are below 1e-9; a wrong formula is off by 1e-3 and more."""


@identity
def moved(original: Original) -> str | Finding:
    """Everything moved by the same vector."""
    at = original.bench
    offset = np.round(original.rng.uniform(-8.0, 8.0, 3), 3)
    x, y, z = offset.tolist()
    other = relations.moved(original.scene, Motion(offset=(x, y, z)))
    hits = query.intersect(other.tables, at.o + offset, at.d)
    return _judged("moved", f"moved by {offset.tolist()}", at, hits, float(np.abs(offset).max()))


@identity
def grouped(original: Original) -> str | Finding | None:
    """Shapes under one more map each, against an instance of a group of them under that map."""
    scene, rng = original.scene, original.rng
    bounded = [s for s in scene.shapes if not isinstance(s, Plane)]
    if not bounded or any(isinstance(s, Solid) for s in bounded):
        return None
    if sum(isinstance(s, Instance) for s in scene.shapes) > 0 and rng.random() < 0.5:
        bounded = [s for s in bounded if not isinstance(s, Instance)] or bounded
    linear = np.eye(3) + 0.3 * rng.normal(size=(3, 3))
    if np.abs(np.linalg.det(linear)) < 0.3:
        return None
    rows = np.column_stack([linear, rng.uniform(-1.0, 1.0, 3)]).tolist()
    step = transform.Matrix.model_validate({"matrix": rows})
    try:
        baked, other, _ = relations.nested(scene, bounded, [step])
        tables = other.tables
    except SceneError:
        return None
    at = bench(baked, rng, original.rays)
    hits = query.intersect(tables, at.o, at.d)
    return _judged("grouped", f"under the map {rows}", at, hits, 0.0)


def _judged(name: str, how: str, at: Bench, hits: Intersections, offset: float) -> str | Finding:
    """Every ray that differs must be one that changes as much when it is moved as far as rounding
    moves surfaces."""
    size = REACH * UNIT_ROUNDOFF
    # Rays that start on an infinite plane may be far outside of the scene's size.
    shift = size * (np.maximum(at.size, np.abs(at.o).max(axis=1)) + offset)
    hits = dataclasses.replace(hits, n=_facing(at.hits, hits))
    differs = _differs(at.hits, hits, size)
    wrong = [k for k in np.flatnonzero(differs).tolist() if not _excused(at, hits, k, shift[k])]
    if not wrong:
        return "agree"
    k = wrong[0]
    cause = "hits differ"
    if (hits.shape[k] < 0) != (at.hits.shape[k] < 0):
        cause = "a hit and a miss"
    elif np.abs(hits.n[k] - at.hits.n[k]).max() > NORMAL:
        cause = "normals differ"
    return Finding(
        rung=f"identity {name}",
        cause=cause,
        detail=f"{how}: {len(wrong)} of {len(at.o)} rays differ; the first, {ray_words(at, k)}: "
        f"{words(at.hits, k)}; then {words(hits, k)}",
    )


def _facing(one: Intersections, other: Intersections) -> FloatArray:
    """The normals (n, 3) of `other`, turned where it hit another face that lies back to back with
    that of `one`: either may be hit."""
    faces = [getattr(one, x) != getattr(other, x) for x in ("shape", "part", "primitive")]
    opposite = np.any(faces, axis=0) & (np.sum(one.n * other.n, axis=1) < 0.0)
    return np.where(opposite[:, None], -other.n, other.n)


def _differs(one: Intersections, other: Intersections, size: float) -> Any:
    """Where hits differ by more than a few roundings."""
    t, t2, n, n2 = one.t, other.t, one.n, other.n
    with np.errstate(invalid="ignore"):  # both may be infinite
        same_t = (t == t2) | (np.abs(t - t2) <= size * np.abs(t))
    missed = ~np.isfinite(t) & ~np.isfinite(t2)
    same_n = np.abs(n - n2).max(axis=1) <= NORMAL
    return ~(missed | (same_t & same_n))


def _excused(at: Bench, hits: Intersections, k: int, shift: float) -> bool:
    """Whether ray k, moved by `shift`, has a hit like the other scene's."""
    moves = np.concatenate([shift * AROUND, 0.4 * shift * AROUND, np.zeros((1, 3))])
    o = at.o[k] + moves
    near = query.intersect(at.tables, o, np.broadcast_to(at.d[k], o.shape))
    if not np.isfinite(hits.t[k]):
        return bool((~np.isfinite(near.t)).any())
    alike = np.isfinite(near.t) & (np.abs(near.n - hits.n[k]).max(axis=1) <= 1e-3)
    if not alike.any():
        return False
    t = near.t[alike]
    length = float(np.linalg.norm(at.d[k]))
    slack = SPREAD * float(t.max() - t.min()) + SPREAD * shift / length
    low, high = float(t.min()) - slack, float(t.max()) + slack
    if not low <= hits.t[k] <= high:
        return False
    spread = SPREAD * np.ptp(near.n[alike], axis=0).max() + NORMAL
    return bool((np.abs(near.n[alike] - hits.n[k]).max(axis=1) <= spread).any())

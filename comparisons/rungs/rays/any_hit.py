"""Any-hit queries (shadow rays): against closest hits, and on rays through every triangle.

Random rays do not show that a traversal misses one triangle of thousands: for meshes rays are aimed
at the triangles one by one.  Both traversals of any-hit queries are tested, blocks of rays and
single rays, each on all rays.
"""

from typing import Any, NamedTuple

import numpy as np

from comparisons.geometry import affine
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.counterpart import Counterpart
from comparisons.mitsuba.scene import for_rays
from comparisons.referee.sizes import ShapeSizes
from comparisons.rungs.rays.rays import Rays, random_rays
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering import query
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.query.hits import BoolArray
from reference_rt.rendering.query.tracing import FEW

MOST_TRIANGLES = 60_000
"""Most triangles that rays are aimed at, in all copies: more are chosen at random."""

AWAY = 0.25
"""Where short rays begin and end, over the size of their triangle: so close that they seldom meet
another one, so far that rounding is nothing beside it."""

BEYOND = 1e-6
"""How far rays go beyond the triangle that they are aimed at, over their length."""

LEAST_COSINE = 0.02
"""Cosine below which a long ray is left out: it grazes its triangle."""

LEAST_FEATURE = 1e-7
"""Height of a triangle over the scene's size below which it is left out: the point that is aimed at
has coordinates of float64, 1e-16 of the scene's size, and BEYOND must be more than that."""


class AnyHits(NamedTuple):
    """rays, triangles: how many were tested, and how many triangles were aimed at;  wrong: how many
    of our answers are wrong;  mitsuba_wrong: of Mitsuba's, which has float32;  first: the first
    wrong answer of ours in words, or ""."""

    rays: int
    triangles: int
    wrong: int
    mitsuba_wrong: int
    first: str


class _Question(NamedTuple):
    """Rays with their ends t_max (n,), what any-hit must answer (n,), and why in words."""

    rays: Rays
    t_max: FloatArray
    answer: BoolArray
    why: str


def any_hits(
    tables: SceneTables,
    counterpart: Counterpart,
    sizes: ShapeSizes,
    rays: Rays,
    hits: Intersections,
    seed: int,
) -> AnyHits:
    """Test any-hit queries on rays with their closest hits, and on rays through triangles."""
    met = hits.shape >= 0
    unlimited = np.full(len(met), np.inf)
    questions = [
        _Question(rays, np.nextafter(hits.t, np.inf), met, "just beyond the closest hit"),
        _Question(rays, unlimited, met, "without an end"),
    ]
    near = rays.rows(np.flatnonzero(met))
    none = np.zeros(len(near.o), bool)
    questions.append(_Question(near, hits.t[met], none, "up to the closest hit"))
    through = _through_triangles(sizes, np.random.default_rng([seed, 3]))
    questions += through
    wrong, first = 0, ""
    for question in questions:
        answers = _answers(tables, question)
        bad = np.flatnonzero((answers != question.answer).any(axis=0))
        wrong += len(bad)
        if len(bad) and not first:
            first = _describe(question, answers, int(bad[0]))
    for question in through:
        # Closest hits must not pass the triangle either.
        t = query.first_hits(tables, question.rays.o, question.rays.d).t
        bad = np.flatnonzero(~(t < question.t_max))
        wrong += len(bad)
        if len(bad) and not first:
            first = f"closest hit: {_ray(question, int(bad[0]))} passes {question.why}"
    return AnyHits(
        rays=sum(len(q.t_max) for q in questions),
        triangles=len(through[0].t_max) if through else 0,
        wrong=wrong,
        mitsuba_wrong=sum(_of_mitsuba(counterpart, q) for q in through),
        first=first,
    )


def _answers(tables: SceneTables, question: _Question) -> BoolArray:
    """(2, n): by blocks of rays, and ray by ray."""
    (o, d), t_max, n = question.rays, question.t_max, len(question.t_max)
    if n == 0:
        return np.zeros((2, 0), bool)
    # Fewer rays than FEW are traced one by one: repeated, they make up blocks.
    times = FEW // n + 1
    blocks = query.occluded(
        tables, np.tile(o, (times, 1)), np.tile(d, (times, 1)), np.tile(t_max, times)
    )[:n]
    single = [
        query.occluded(tables, o[k : k + FEW], d[k : k + FEW], t_max[k : k + FEW])
        for k in range(0, n, FEW)
    ]
    return np.stack([blocks, np.concatenate(single)])


def _through_triangles(sizes: ShapeSizes, rng: np.random.Generator) -> list[_Question]:
    """Short rays across each triangle, and long ones from anywhere in the scene to it."""
    corners = _triangles(sizes, rng)
    if len(corners) == 0:
        return []
    # Well inside: weights of at least 0.1.
    weights = 0.1 + 0.7 * rng.dirichlet(np.ones(3), len(corners))
    p = np.einsum("nk,nki->ni", weights, corners)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    height = np.divide(area, edges, out=np.zeros_like(area), where=edges > 0.0)
    size = float((sizes.upper - sizes.lower).max())
    fine = np.flatnonzero(height > LEAST_FEATURE * max(size, float(np.abs(p).max())))
    p, height = p[fine], height[fine]
    normal = normal[fine] / area[fine, None]
    side = np.where(rng.uniform(size=(len(p), 1)) < 0.5, -1.0, 1.0)
    away = AWAY * height[:, None] * side * normal
    ones = np.ones(len(p), bool)
    short = _Question(Rays(p + away, -2.0 * away), np.ones(len(p)), ones, "a triangle")
    start = random_rays(sizes, len(p), rng).o
    cosine = np.abs(np.sum((p - start) * normal, axis=1))
    cosine /= np.maximum(np.linalg.norm(p - start, axis=1), 1e-300)
    seen = np.flatnonzero(cosine > LEAST_COSINE)
    far = Rays(start[seen], p[seen] - start[seen])
    long = _Question(far, np.full(len(seen), 1.0 + BEYOND), ones[seen], "a triangle")
    return [short, long]


def _triangles(sizes: ShapeSizes, rng: np.random.Generator) -> FloatArray:
    """Corners (n, 3, 3) in the scene of the triangles of all copies, without those of solids."""
    corners_of = [np.zeros((0, 3, 3))]
    meshes = [
        (copy, leaf)
        for copy in sizes.copies
        if not any(member.tree is not None for member in copy.members)
        for leaf in sizes.leaves_of(copy)
        if leaf.field == "triangles"
    ]
    total = sum(len(leaf.table.vertices) for _, leaf in meshes)
    share = min(1.0, MOST_TRIANGLES / total) if total else 1.0
    counts = rng.binomial([len(leaf.table.vertices) for _, leaf in meshes], share)
    for (copy, leaf), count in zip(meshes, counts.tolist(), strict=True):
        rows = _some(len(leaf.table.vertices), count, rng)
        corners = leaf.table.vertices[rows].reshape(-1, 3)
        corners_of.append(affine.apply_points(copy.outer, corners).reshape(-1, 3, 3))
    return np.concatenate(corners_of)


def _some(n: int, count: int, rng: np.random.Generator) -> IntArray:
    return np.arange(n) if count >= n else rng.choice(n, count, replace=False)


def _of_mitsuba(counterpart: Counterpart, question: _Question) -> int:
    """How many of Mitsuba's answers are wrong; 0 where it has no scene with all shapes."""
    if counterpart.instanced_group is not None or len(question.t_max) == 0:
        return 0
    mi = mitsuba()
    mi_scene = counterpart.mi_scene
    # Mitsuba's ray: a unit direction, and its end as a length.
    o, d = counterpart.frame.into(question.rays.o), question.rays.d
    length = np.linalg.norm(d, axis=1)
    end = question.t_max * length * counterpart.frame.scale * (1.0 + 1e-4)

    def test(origin: Any, direction: Any, maximum: Any) -> tuple[Any, ...]:
        ray = mi.Ray3f(mi.Point3f(origin), direction)
        ray.maxt = maximum
        return (mi_scene.ray_test(ray),)

    answers = for_rays(test, o, d / length[:, None], end)[0].astype(bool)
    return int(np.count_nonzero(answers != question.answer))


def _describe(question: _Question, found: BoolArray, k: int) -> str:
    which = "by blocks" if found[0, k] != question.answer[k] else "ray by ray"
    says = "nothing" if question.answer[k] else "something"
    return f"any-hit, {which}: {_ray(question, k)} meets {says} ({question.why})"


def _ray(question: _Question, k: int) -> str:
    o, d = question.rays.o[k].tolist(), question.rays.d[k].tolist()
    return f"the ray from {o} along {d} up to t = {question.t_max[k]:.17g}"


__all__ = ["AnyHits", "any_hits"]

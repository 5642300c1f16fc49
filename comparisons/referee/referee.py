"""The exact first hit of rays in a whole scene, which decides which tracer is right."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from comparisons.geometry.exact.crossings import Crossings, IntArray
from comparisons.geometry.exact.dyadic import (
    CERTAIN,
    FRACTION,
    NEVER,
    SLACK,
    BoolArray,
    Dyadic,
    FloatArray,
    apply,
    nearest,
)
from comparisons.geometry.flatten import Copy, Member, Tree
from comparisons.referee import KINDS, columns_of
from comparisons.referee.sizes import LeafSizes, ShapeSizes, corners_of
from reference_rt.rendering.query import Intersections

MARGIN = 1e-9
"""Enlargement of boxes and triangles, as a fraction of the scene's size, when floats cull
candidates: more than a thousand times the rounding."""

Identity = tuple[int, int, int, int]
"""(shape, instance, part, primitive)."""


def identity_of(hits: Intersections, k: int) -> Identity:
    """Which surface hit k is on."""
    shape, instance, part, primitive = (
        int(getattr(hits, n)[k]) for n in ("shape", "instance", "part", "primitive")
    )
    return shape, instance, part, primitive


class Crossing(NamedTuple):
    """One crossing of one ray: t as a fixed-point number, the surface, whether the ray enters."""

    t: int
    identity: Identity
    enters: bool


@dataclass
class Truth:
    """The exact first hit of a ray.

    t: a fixed-point number, NEVER for a miss;  identities: the surfaces there, several if they
    coincide, none for a miss;  touching: the ray passes exactly through an edge of some shape.
    """

    t: int
    identities: list[Identity]
    touching: bool = False

    def agrees(self, hits: Intersections, k: int, slack: float) -> bool:
        """Whether hit k is one of these surfaces, with t within `slack`."""
        found = identity_of(hits, k)
        if found[0] < 0:
            return not self.identities
        t = float(nearest(np.array([self.t], dtype=object))[0])
        return found in self.identities and abs(float(hits.t[k]) - t) <= slack


class Referee:
    """Finds exact first hits in one scene, from its description alone.

    together: operands of a solid are hit in one place if their crossings are closer than this
    fraction of the scene's size.  Where faces coincide, their rounded tables do not.
    """

    def __init__(self, sizes: ShapeSizes, together: float = 0.0) -> None:
        self.sizes, self._together = sizes, together
        self.margin = MARGIN * float(np.abs([sizes.lower, sizes.upper]).max())
        boxes = [_box(copy, sizes.leaves_of(copy)) for copy in sizes.copies]
        self.lower, self.upper = (np.array(side) for side in zip(*boxes, strict=True))

    def decide(self, o: FloatArray, d: FloatArray) -> list[Truth]:
        """The exact first hit of each ray (n, 3)."""
        truths = [Truth(int(NEVER), []) for _ in o]
        reach = np.abs(o).max(axis=1, keepdims=True) * MARGIN + self.margin
        slack = self._together * reach[:, 0] / MARGIN / np.linalg.norm(d, axis=1)
        for number, copy in enumerate(self.sizes.copies):
            near = _meets_box(o, d, self.lower[number] - reach, self.upper[number] + reach)
            rays = np.flatnonzero(near)
            if len(rays):
                self._add(copy, rays, o[rays], d[rays], slack[rays], truths)
        return truths

    def _add(
        self,
        copy: Copy,
        rays: IntArray,
        o: FloatArray,
        d: FloatArray,
        slack: FloatArray,
        truths: list[Truth],
    ) -> None:
        exact_o, exact_d = Dyadic.of(o), Dyadic.of(d)
        if copy.instance >= 0:
            # The inverse matrix as in our tables: it is rounded, and exact by definition from here.
            m = Dyadic.of(np.linalg.inv(copy.outer[:, :3]).reshape(1, 9))
            exact_o = apply(m, exact_o - Dyadic.of(copy.outer[None, :, 3]))
            exact_d = apply(m, exact_d)
            o, d = exact_o.floats(), exact_d.floats()
        leaves = self.sizes.by_part(copy)
        for member in copy.members:
            per_leaf = [
                crossings_of(leaves[leaf.part], (o, d), (exact_o, exact_d))
                for leaf in member.leaves
            ]
            for k, ray in enumerate(rays.tolist()):
                found = [
                    [Crossing(t, (copy.shape, copy.instance, leaf.part, code), enters)
                     for t, code, enters in lists[k]]
                    for leaf, (lists, _) in zip(member.leaves, per_leaf, strict=True)
                ]  # fmt: skip
                touching = any(bool(flags[k]) for _, flags in per_leaf)
                _merge(truths[ray], _first(member, found, fixed(slack[k])), touching)


def _box(copy: Copy, leaves: list[LeafSizes]) -> tuple[FloatArray, FloatArray]:
    """The bounding box of a copy, infinite if any of its shapes is."""
    if not all(leaf.is_finite for leaf in leaves):
        return np.full(3, -np.inf), np.full(3, np.inf)
    corners = np.concatenate([corners_of(leaf.bounds, copy.outer) for leaf in leaves])
    return corners.min(axis=0), corners.max(axis=0)


def _meets_box(o: FloatArray, d: FloatArray, lower: FloatArray, upper: FloatArray) -> BoolArray:
    """Whether lines pass near boxes: conservative, in floats."""
    # Divisions by 0 (rays parallel to the planes), and infinite boxes.
    with np.errstate(all="ignore"):
        a, b = (lower - o) / d, (upper - o) / d
        low = np.nan_to_num(np.minimum(a, b), nan=-np.inf).max(axis=1)
        high = np.nan_to_num(np.maximum(a, b), nan=np.inf).min(axis=1)
        return np.asarray(low <= high + MARGIN * (1.0 + np.abs(high)))


Lists = tuple[list[list[tuple[int, int, bool]]], BoolArray]
"""(t, code, enters) of the crossings of each ray, and which rays touch."""


def crossings_of(
    leaf: LeafSizes, rays: tuple[FloatArray, FloatArray], exact: tuple[Dyadic, Dyadic]
) -> Lists:
    """All crossings of a leaf, over all t, in order."""
    row = columns_of(leaf.table)
    n = len(rays[0])
    lists: list[list[tuple[int, int, bool]]] = [[] for _ in range(n)]
    touching = np.zeros(n, bool)
    if leaf.known.near is None:
        found = KINDS[leaf.field](row, *exact)
        for k, t, code, enters in _entries(found):
            lists[k].append((t, code, enters))
        # A line parallel to an infinite plane does not show on which side it is.
        along = [leaf.field == "planes" and not some for some in lists]
        return lists, found.touching | along
    for k in range(n):
        near = leaf.known.near(row, rays[0][k], rays[1][k])
        if len(near) == 0:
            continue
        some = {name: np.asarray(row[name])[near] for name in ("vertices", "face")}
        found = KINDS[leaf.field](some, exact[0][k : k + 1], exact[1][k : k + 1])
        lists[k] = sorted((t, code, enters) for _, t, code, enters in _entries(found))
        touching[k] = found.touching.any()
    return lists, touching


def _entries(found: Crossings) -> Iterator[tuple[int, int, int, bool]]:
    for k, j in zip(*np.nonzero(found.t != NEVER), strict=True):
        yield int(k), int(found.t[k, j]), int(found.code[k, j]), bool(found.enters[k, j])


def _first(member: Member, found: list[list[Crossing]], slack: int) -> tuple[int, list[Identity]]:
    """t and the surfaces of the first hit beyond t = 0; of a solid, all within `slack` of it."""
    if member.tree is None:
        ahead = [c for c in found[0] if c.t > 0]
        if not ahead:
            return int(NEVER), []
        t = min(c.t for c in ahead)
        return t, [c.identity for c in ahead if _tied(c.t, t)]
    states = [_begins_inside(crossings) for crossings in found]
    events = sorted((c.t, k, c) for k, crossings in enumerate(found) for c in crossings if c.t > 0)
    inside = evaluated(member.tree, states)
    position = 0
    while position < len(events):
        t, group = events[position][0], []
        while position < len(events) and _tied(events[position][0], t):
            _, k, crossing = events[position]
            states[k] += 1 if crossing.enters else -1
            group.append(crossing.identity)
            position += 1
        if evaluated(member.tree, states) != inside:
            here = [c.identity for _, _, c in events if abs(c.t - t) <= slack]
            return t, here if slack else group
    return int(NEVER), []


def _begins_inside(crossings: list[Crossing]) -> int:
    """How many times an operand encloses t = 0, from its crossings ahead."""
    ahead = [c for c in crossings if c.t > 0]
    if ahead:
        return (
            sum(-1 if c.enters else 1 for c in ahead)
            if len(ahead) > 1
            else int(not ahead[0].enters)
        )
    return int(bool(crossings) and max(crossings, key=lambda c: c.t).enters)


def evaluated(tree: Tree | int, states: list[int]) -> bool:
    """Whether a point is inside the solid: `states` counts how often each operand encloses it."""
    if isinstance(tree, int):
        return states[tree] != 0
    values = [evaluated(part, states) for part in tree.of]
    if tree.operation == "union":
        return any(values)
    if tree.operation == "intersection":
        return all(values)
    return values[0] and not any(values[1:])


def _merge(truth: Truth, first: tuple[int, list[Identity]], touching: bool) -> None:
    t, identities = first
    truth.touching |= touching
    if not identities:
        return
    if truth.identities and _tied(t, truth.t):
        truth.identities += identities
    elif t < truth.t:
        truth.t, truth.identities = t, identities


def fixed(value: float) -> int:
    """A float as a fixed-point number."""
    return int(value * 2.0**64) << (FRACTION - 64)


def _tied(a: int, b: int) -> bool:
    """As `dyadic.tied`."""
    return abs(a - b) <= (max(abs(a), abs(b)) >> CERTAIN) + SLACK

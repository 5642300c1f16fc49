"""Hits of one shape against exact arithmetic, and how near to the shape they are.

A tracer rounds, and so answers for a ray and a shape that are moved a little: by at most
`band` = 144 u D, with D the largest coordinate of ray origins plus the largest of the shape.  Our
triangles are the least certain: each coordinate of a vertex is projected within 15 u D, and a point
named by barycentrics to within 16 u of a projected triangle at most 4 D across: 79 u D, times
sqrt(3) for three of them.

An answer is right if some ray moved by no more has it exactly:

- a hit, if it lies within PIXEL of the exact one, in sizes of the shape; or if its point o + t d is
  within the band of the shape, and no nearer surface is certain;
- a miss, if it is one; or if one of RING rays that are moved across by the band misses."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from comparisons.experiments.stability.harness.outcomes import (
    FloatArray,
    Outcome,
    U,
    hexed,
    outcome,
)
from comparisons.geometry.affine import unit_rows
from comparisons.geometry.exact.dyadic import BoolArray, Dyadic, cross
from comparisons.referee import first_hit

PIXEL = 1e-3
"""A hit is misplaced if it is off by more than this share of the shape's size: a pixel, where the
shape fills a picture 1000 pixels wide."""

BAND = 144.0 * U

RING = 16
"""Rays around one, moved across it."""

Extended = npt.NDArray[np.longdouble]


@dataclass(frozen=True)
class Question:
    """Rays o, d (n, 3) at one shape: row (its columns, of one row), kind as
    `comparisons.referee` names it, size its largest extent."""

    kind: str
    row: Mapping[str, Any]
    o: FloatArray
    d: FloatArray
    size: float

    @property
    def reach(self) -> float:
        """D of the module's text."""
        return float(np.abs(self.o).max()) + _largest(self.kind, self.row)

    @property
    def band(self) -> float:
        return BAND * self.reach

    def moved(self, which: npt.NDArray[np.int64]) -> tuple[FloatArray, FloatArray]:
        """RING rays in place of each of these, one after another."""
        o, d = (np.repeat(x[which], RING, axis=0) for x in (self.o, self.d))
        along = unit_rows(d)
        least = np.eye(3)[np.abs(along).argmin(axis=1)]
        x = unit_rows(np.cross(along, least))
        y = np.cross(along, x)
        angle = np.tile(2.0 * np.pi * np.arange(RING) / RING, len(which))[:, None]
        return o + self.band * (np.cos(angle) * x + np.sin(angle) * y), d


class Judge:
    """Computes the truth about one question, and judges answers to it."""

    def __init__(self, question: Question) -> None:
        self.question = question
        hits = first_hit(question.kind, question.row, question.o, question.d)
        self.t, self.touching = hits.t, hits.touching

    def outcome(self, t: FloatArray) -> Outcome:
        """Of answers t (n,), inf for a miss.  `worst`: how far from the shape hits are, in u D."""
        q, found = self.question, np.isfinite(t)
        off = self._distances(found, t)
        worst = float((off[found] / (U * q.reach)).max()) if found.any() else None
        wrong = self._wrong(t, off)
        shape = {name: np.ravel(v) for name, v in q.row.items() if name in _SHAPES[q.kind]}
        shown = {"shape": {name: hexed(v) for name, v in shape.items()}, "origin": q.o}
        shown |= {"direction": q.d, "expected": self.t, "found": t}
        return outcome(wrong, shown, wrong & self.touching, worst)

    def wrong(self, t: FloatArray) -> BoolArray:
        """Which of answers t (n,) are."""
        return self._wrong(t, self._distances(np.isfinite(t), t)) & ~self.touching

    def _wrong(self, t: FloatArray, off: FloatArray) -> BoolArray:
        q, found, there = self.question, np.isfinite(t), np.isfinite(self.t)
        # inf - inf of misses is of no interest.
        with np.errstate(invalid="ignore"):
            apart = np.abs(t - self.t) * np.linalg.norm(q.d, axis=1)
        near = found & there & (apart <= PIXEL * q.size)
        wrong = found & ~near & (off > q.band)
        doubtful = np.flatnonzero((found & ~near & ~wrong) | (~found & there))
        wrong[doubtful] = self._is_certain(doubtful, t)
        return np.asarray(wrong)

    def _distances(self, found: BoolArray, t: FloatArray) -> FloatArray:
        """Of the points that were found from the shape; 0 for none."""
        q = self.question
        off = np.zeros(len(t))
        o, d, at = (np.asarray(x[found], np.longdouble) for x in (q.o, q.d, t))
        off[found] = DISTANCES[q.kind](q.row, o + at[:, None] * d)
        return off

    def _is_certain(self, which: npt.NDArray[np.int64], t: FloatArray) -> BoolArray:
        """Whether all moved rays hit, and before t by more than PIXEL."""
        q = self.question
        if len(which) == 0:
            return np.zeros(0, np.bool_)
        o, d = q.moved(which)
        seen = first_hit(q.kind, q.row, o, d).t.reshape(-1, RING)
        slack = PIXEL * q.size / np.linalg.norm(q.d[which], axis=1)
        return np.asarray((seen < (t[which] - slack)[:, None]).all(axis=1))


_SHAPES = {
    "triangles": ("vertices",),
    "rectangles": ("center", "normal", "x_of", "y_of"),
    "disks": ("center", "normal", "x_of", "y_of"),
    "boxes": ("center", "to_local"),
}
"""The columns that say where a shape is."""


def _largest(kind: str, row: Mapping[str, Any]) -> float:
    """The largest coordinate of a shape, or more."""
    if kind == "triangles":
        return float(np.abs(row["vertices"]).max())
    edges = [row["edges"]] if kind == "boxes" else [row["x_edge"], row["y_edge"]]
    reach = sum(np.abs(np.reshape(e, (-1, 3))).sum(axis=0) for e in edges)
    return float((np.abs(np.ravel(row["center"])) + reach).max())


def _length(v: Extended) -> Extended:
    return np.asarray(np.sqrt((v * v).sum(axis=-1)))


def _of_triangle(row: Mapping[str, Any], p: Extended) -> FloatArray:
    """From its plane where the point is over it, and from its edges: the smaller, which is never
    below the distance."""
    v = np.asarray(row["vertices"], np.longdouble).reshape(3, 3)
    n = _normal(np.asarray(row["vertices"], np.float64).reshape(3, 3))
    inside = np.ones(len(p), np.bool_)
    nearest = np.full(len(p), np.inf, np.longdouble)
    for k in range(3):
        a, edge = v[k], v[(k + 1) % 3] - v[k]
        share = np.clip(((p - a) @ edge) / (edge @ edge), 0.0, 1.0)
        nearest = np.minimum(nearest, _length(p - (a + share[:, None] * edge)))
        inside &= (np.cross(edge, p - a) @ n) >= 0
    above = np.abs((p - v[0]) @ n) / _length(n)
    return np.asarray(np.where(inside, np.minimum(above, nearest), nearest), np.float64)


def _normal(v: FloatArray) -> Extended:
    """Of a triangle (3, 3): of a sliver extended precision's cross product would not do."""
    a = Dyadic.of(v)
    n = cross(a[1] - a[0], a[2] - a[0])
    high = n.floats()
    low = (n - Dyadic.of(high)).floats()
    return np.asarray(np.asarray(high, np.longdouble) + low)


def _of_flat(row: Mapping[str, Any], p: Extended, is_round: bool) -> FloatArray:
    """Out of the plane, plus beyond the rim in it."""
    center, n, x_of, y_of, x_edge, y_edge = (
        np.asarray(row[name], np.longdouble).reshape(3)
        for name in ("center", "normal", "x_of", "y_of", "x_edge", "y_edge")
    )
    q = p - center
    x, y = q @ x_of, q @ y_of
    above = np.abs(q @ n) / _length(n)
    if is_round:
        radius = max(float(_length(x_edge)), float(_length(y_edge)))
        beyond = np.maximum(np.sqrt(x * x + y * y) - 1.0, 0.0) * radius
    else:
        beyond = np.maximum(np.abs(x) - 1.0, 0.0) * _length(x_edge)
        beyond += np.maximum(np.abs(y) - 1.0, 0.0) * _length(y_edge)
    return np.asarray(above + beyond, np.float64)


def _of_box(row: Mapping[str, Any], p: Extended) -> FloatArray:
    """Outside of it, along its edges; inside, from the nearest face."""
    q = (p - np.asarray(row["center"], np.longdouble).reshape(3)) @ np.asarray(
        row["to_local"], np.longdouble
    ).reshape(3, 3).T
    lengths = _length(np.asarray(row["edges"], np.longdouble).reshape(3, 3))
    beyond = (np.maximum(np.abs(q) - 1.0, 0.0) * lengths).sum(axis=1)
    within = (np.abs(np.abs(q) - 1.0) * lengths).min(axis=1)
    return np.asarray(np.where(beyond > 0.0, beyond, within), np.float64)


DISTANCES: dict[str, Callable[[Mapping[str, Any], Extended], FloatArray]] = {
    "triangles": _of_triangle,
    "rectangles": lambda row, p: _of_flat(row, p, is_round=False),
    "disks": lambda row, p: _of_flat(row, p, is_round=True),
    "boxes": _of_box,
}
"""Distances (n,) of points (n, 3) from a shape.  Extended precision is good to 2^-11 of the band;
where long doubles are doubles, to a hundredth of it."""

"""Pictures of failures: the same small view by each method of a family."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from comparisons.experiments.methods import of_csg
from comparisons.experiments.methods.errors import PIXEL
from comparisons.experiments.methods.run import FAMILIES, Row
from comparisons.experiments.methods.summary import short
from comparisons.experiments.methods.vectors import unit_rows
from comparisons.experiments.methods.wording import percent
from comparisons.geometry.exact.dyadic import NEVER
from comparisons.report.thumbnails import png_url
from comparisons.report.values import power_of_ten
from reference_rt import textbook
from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray
from reference_rt.textbook import CsgParameters, SphereParameters, TriangleParameters

SIDE = 72
"""Pixels."""

GROUND = np.array([0.93, 0.94, 0.95])
PAINT = np.array([0.30, 0.47, 0.66])
WRONG = np.array([0.85, 0.20, 0.12])


@dataclass(frozen=True)
class Failure:
    """title: what is seen;  note: what the colours mean;  views: (method, data URL, caption)."""

    title: str
    note: str
    views: list[tuple[str, str, str]]


def failures(rows: Sequence[Row]) -> dict[str, Failure]:
    """By family, of those that were measured and have failures."""
    measured = {row.family for row in rows}
    found: dict[str, Failure | None] = {}
    if "sphere" in measured:
        found["sphere"] = _sphere(rows)
    if "triangle" in measured:
        found["triangle"] = _wall()
    if "csg" in measured:
        found["csg"] = _film()
    return {family: failure for family, failure in found.items() if failure}


def _png(pixels: FloatArray) -> str:
    return png_url(255.0 * np.clip(pixels, 0.0, 1.0))


def _grid() -> FloatArray:
    """(SIDE², 2): pixel centres in [-1, 1]², row 0 at the top."""
    centres = (np.arange(SIDE) + 0.5) / SIDE * 2.0 - 1.0
    x, y = np.meshgrid(centres, -centres)
    return np.stack([x.ravel(), y.ravel()], axis=1)


def _shown(colours: FloatArray) -> str:
    return _png(colours.reshape(SIDE, SIDE, 3))


# ---- a far sphere -------------------------------------------------------------------------------


def _sphere(rows: Sequence[Row]) -> Failure | None:
    """Seen from the smallest distance of the series at which a method is wrong.

    Each method traces its own shadow rays, from 1/1000 of a radius above its hit point.
    """
    some = [row for row in rows if (row.family, row.series) == ("sphere", "distance")]
    failing = [row.x for row in some if row.errors.wrong > row.errors.ties]
    if not failing:
        return None
    distance = min(failing)
    shape = SphereParameters((0.2, -0.1, 0.3), 1.0)
    center = np.array(shape.center)
    back = unit_rows(np.array([0.3, 0.2, 1.0]))
    right = unit_rows(np.cross([0.0, 1.0, 0.0], back))
    target = center + 1.15 * _grid() @ np.stack([right, np.cross(back, right)])
    o = np.tile(center + distance * back, (len(target), 1))
    d = target - o
    truth = FAMILIES["sphere"].exact(shape, o, d)
    hit = np.asarray(truth.t != NEVER, dtype=bool)
    lamp = unit_rows(back + 0.6 * right + np.array([0.0, 0.8, 0.0]))
    views = []
    for name in FAMILIES["sphere"].methods:
        t = textbook.intersect(name, shape, o, d)
        found = np.isfinite(t)
        p = o + np.where(found, t, 0.0)[:, None] * d
        n = unit_rows(p - center)
        lamps = np.tile(lamp, (len(p), 1))
        dark = np.isfinite(textbook.intersect(name, shape, p + PIXEL * n, lamps))
        light = np.where(dark, 0.0, np.clip(n @ lamp, 0.0, 1.0)) + 0.1
        colours = np.where(found[:, None], light[:, None] * (PAINT + 0.3), GROUND)
        colours[found != hit] = WRONG
        lost = float(np.mean(~found[hit]))
        black = float(np.mean((dark & (n @ lamp > 0.1))[hit & found]))
        said = [f"{percent(lost)} of the hits lost"] if lost else []
        said += [f"{percent(black)} wrongly in shadow"] if black else []
        views.append((short(name), _shown(colours), ", ".join(said)))
    return Failure(
        f"A sphere seen from {power_of_ten(distance)} radii",
        "Dark: the shadow ray, from 1/1000 of a radius above the hit point, hits the sphere.  Red:"
        " a lost hit or a false one.",
        views,
    )


# ---- a wall of triangles ------------------------------------------------------------------------

CELL = 3
"""Pixels across each square of the wall."""


def _wall() -> Failure:
    """Squares of two triangles; every third pixel lies on the edge between the two."""
    n = SIDE // CELL
    axis = np.linspace(-1.0, 1.0, n + 1)
    x, y = np.meshgrid(axis, -axis)
    corners = np.stack([x, y, 0.1 * np.sin(4.0 * x + y) * np.cos(3.0 * y)], axis=-1)
    eye = np.array([0.3, 0.2, 4.0])
    light = unit_rows(np.array([0.5, 0.7, 1.0]))
    share = (np.arange(CELL) + 0.5) / CELL
    colours = {name: np.tile(WRONG, (SIDE, SIDE, 1)) for name in FAMILIES["triangle"].methods}
    for row in range(n):
        for column in range(n):
            a, b = corners[row, column], corners[row, column + 1]
            c, d = corners[row + 1, column], corners[row + 1, column + 1]
            halves = (a, b, d), (a, d, c)
            targets = np.array([_in_square(a, b, c, d, u, v) for v in share for u in share])
            o = np.tile(eye, (len(targets), 1))
            for name, picture in colours.items():
                for half in halves:
                    t = textbook.intersect(name, TriangleParameters(*half), o, targets - o)
                    normal = unit_rows(np.cross(half[1] - half[0], half[2] - half[0]))
                    shade = (PAINT + 0.3) * abs(normal @ light)
                    cell = picture[CELL * row :][:CELL, CELL * column :][:, :CELL]
                    cell[np.isfinite(t).reshape(CELL, CELL)] = shade
    edge = SIDE * SIDE // CELL
    views = []
    for name, picture in colours.items():
        holes = int(np.sum(np.all(picture == WRONG, axis=-1)))
        views.append(
            (short(name), _png(picture), f"{holes} of {edge:,} rays leak" if holes else "")
        )
    return Failure(
        "A wall of triangles; every third pixel is aimed at an edge that two of them share",
        "Red: the ray hits neither triangle.",
        views,
    )


def _in_square(
    a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray, u: float, v: float
) -> FloatArray:
    """The point at u to the right, v down: on triangle a b d above the diagonal, else on a d c."""
    if u >= v:
        return np.asarray(a + (u - v) * (b - a) + v * (d - a))
    return np.asarray(a + (v - u) * (c - a) + u * (d - a))


# ---- a film -------------------------------------------------------------------------------------


def _film() -> Failure:
    """A rotated cube, seen from the side that is subtracted."""
    turn = transform.Rotate(rotate=transform.Turn(axis=(1.0, 2.0, 3.0), degrees=71.0))
    solid = CsgParameters(of_csg.cut_box(0.3, 0.0, turn))
    m = transform.affine((turn,))[:, :3]
    grid = _grid() * 1.75
    back = unit_rows(np.array([1.0, 0.45, 0.35]))
    right = unit_rows(np.cross([0.0, 1.0, 0.0], back))
    target = grid @ np.stack([right, np.cross(back, right)])
    o = target + 6.0 * back
    d = np.tile(-back, (len(o), 1))
    views: list[tuple[str, str, str]] = []
    for name, method in FAMILIES["csg"].methods.items():
        t = method.intersect(solid, o @ m.T, d @ m.T)
        found = np.isfinite(t)
        q = o + np.where(found, t, 0.0)[:, None] * d
        # In the cube's own coordinates, in which the remaining box is -1 <= x <= 0.4.
        side = np.argmax(np.abs((q - np.array([-0.3, 0.0, 0.0])) / (0.7, 1.0, 1.0)), axis=1)
        shade = np.array([1.0, 0.75, 0.55])[side][:, None] * (PAINT + 0.3)
        colours = np.where(found[:, None], shade, GROUND)
        film = found & (q[:, 0] > 0.5)
        colours[film] = WRONG
        views.append(
            (
                short(name),
                _shown(colours),
                f"{film.sum():,} of {len(o):,} pixels" if film.any() else "",
            )
        )
    return Failure(
        "A rotated cube minus a slab at one side: a face of each coincides with one of the other",
        "Red: the method leaves a film of the cube where the ray should hit nothing.",
        views,
    )

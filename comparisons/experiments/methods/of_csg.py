"""CSG solids: more and more operands, and coincident faces.

The coincident faces are planes with coordinates of few bits under a shear with integer entries,
whose inverse has integer entries too: the tables hold them exactly, and a film that a method leaves
between them is its own rounding error.
"""

from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.methods.setting import Draw, Family, Trial, Truth, powers
from comparisons.experiments.methods.vectors import unit_vectors
from comparisons.geometry.exact.dyadic import NEVER
from comparisons.geometry.exact.referee import Referee
from comparisons.geometry.sizes import ShapeSizes
from reference_rt import textbook
from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray
from reference_rt.textbook import CsgParameters, Method, SceneParameters

SHEAR = ((1.0, 1.0, -1.0, 0.0), (0.0, 1.0, 1.0, 0.0), (0.0, 0.0, 1.0, 0.0))
"""Rows of a matrix of determinant 1."""

RENDERS = textbook.METHODS["hierarchy.none"]

SHAPES = 8
"""Rotations of the rotated box."""

CHECKED = 2000
"""Rays of a setting that are checked by exact arithmetic, at most: 0.3 ms each."""


def _prepare_renderer(parameters: CsgParameters) -> Any:
    return RENDERS.prepare(SceneParameters(rt.Scene(shapes=(parameters.solid,))))


EVENTS = Method(
    "csg.renderer",
    "T12",
    "crossings in order, near ones at once: the renderer's own",
    "reference_rt.accel.csg",
    CsgParameters,
    _prepare_renderer,
    RENDERS.run,
)


def exact(parameters: CsgParameters, o: FloatArray, d: FloatArray) -> Truth:
    truths = Referee(ShapeSizes(rt.Scene(shapes=(parameters.solid,)))).decide(o, d)
    t = np.array([truth.t if truth.identities else int(NEVER) for truth in truths], dtype=object)
    return Truth(t, np.array([truth.touching for truth in truths]))


CSG = Family("csg", exact, (EVENTS,), lambda _, wanted: min(wanted, CHECKED))


def _vector(center: FloatArray) -> tuple[float, float, float]:
    x, y, z = center.tolist()
    return x, y, z


def _turn(rng: np.random.Generator) -> transform.Rotate:
    axis = _vector(unit_vectors(rng, 1)[0])
    return transform.Rotate(rotate=transform.Turn(axis=axis, degrees=rng.uniform(0.0, 360.0)))


@CSG.sweep("operands", "operands", powers(1, 2, 3, 4, 5, 6, base=2.0), extreme=32.0)
def operands(draw: Draw, number: float) -> list[Trial]:
    """Spheres and rotated boxes in a unit ball: the union of half of them minus the other half;
    camera rays from all around."""
    shapes: list[Any] = []
    rng = draw.rng
    for k in range(int(number)):
        center = _vector(unit_vectors(rng, 1)[0] * rng.uniform(0.2, 0.9))
        size = float(number) ** (-1.0 / 3.0)
        steps = (transform.Scale(scale=size), _turn(rng), transform.Translate(translate=center))
        shapes.append(
            rt.Sphere(center=center, radius=1.2 * size) if k % 2 == 0 else rt.Box(transform=steps)
        )
    half = (len(shapes) + 1) // 2
    solid = rt.Difference(of=(rt.Union(of=tuple(shapes[:half])), *shapes[half:]))
    o = 3.0 * unit_vectors(rng, draw.rays)
    d = rng.uniform(-0.8, 0.8, (draw.rays, 3)) - o
    return [Trial((CsgParameters(solid),), o, d, 2.0)]


def slab(half_width: float, middle: float, *steps: transform.Step) -> rt.Box:
    """The cube [-1, 1]³, scaled to this half width along x and centred at x = middle."""
    narrow = transform.Scale(scale=(half_width, 1.0, 1.0))
    aside = transform.Translate(translate=(middle, 0.0, 0.0))
    return rt.Box(transform=(narrow, aside, *steps))


def cut_box(half_width: float, overlap: float, *steps: transform.Step) -> Any:
    """The cube minus a slab on its +x side, which extends beyond it by `overlap`."""
    return rt.Box(transform=steps) - slab(half_width, 1.0 - half_width + overlap, *steps)


def _rays_through_the_cut(
    rng: np.random.Generator, n: int, m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Rays at points of what was subtracted, from its side: they cross the face that is gone."""
    o = rng.uniform((2.0, -0.8, -0.8), (3.0, 0.8, 0.8), (n, 3))
    target = rng.uniform((0.45, -0.7, -0.7), (0.9, 0.7, 0.7), (n, 3))
    return o @ m.T, (target - o) @ m.T


@CSG.sweep(
    "overlap", "size / overlap", powers(4, 16, 32, 44, 47, 50, 52, base=2.0), extreme=2.0**32
)
def overlapping(draw: Draw, inverse: float) -> list[Trial]:
    """A sheared cube minus a slab as wide as one half of it, which extends beyond the cube by a
    small overlap; rays from that side at points of what was subtracted."""
    shear = transform.Matrix(matrix=SHEAR)
    solid = cut_box(0.5, 0.0 if np.isinf(inverse) else 1.0 / inverse, shear)
    o, d = _rays_through_the_cut(draw.rng, draw.rays, np.array(SHEAR)[:, :3])
    return [Trial((CsgParameters(solid),), o, d, 2.0)]


@CSG.sweep("coincident")
def coincident(draw: Draw, _: float) -> list[Trial]:
    """The same without any overlap: both faces lie in one plane."""
    return overlapping(draw, np.inf)


@CSG.sweep("turned")
def turned(draw: Draw, _: float) -> list[Trial]:
    """A cube minus a slab of 0.3 of its width under any rotation, which rounds the coincident faces
    apart; the exact answer is that of the box that is left."""
    trials = []
    for _shape in range(SHAPES):
        turn = _turn(draw.rng)
        m = transform.affine((turn,))[:, :3]
        o, d = _rays_through_the_cut(draw.rng, draw.rays // SHAPES, m)
        ideal = (CsgParameters(slab(0.7, -0.3, turn)),)
        trials.append(Trial((CsgParameters(cut_box(0.3, 0.0, turn)),), o, d, 2.0, ideal))
    return trials

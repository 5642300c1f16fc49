"""Random slivers, and rays that graze.

"Aligned" shapes lie in a plane x = 0, y = 0 or z = 0: their heights and the rays' angles are
numbers of their own, not differences of others, and so float32 has them as exactly as float64.
"Turned" ones lie anywhere, and both are differences: the rounding of vertices and rays is part of
the question.

`singles`: all numbers are rounded to float32, and Mitsuba gets what ours gets.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.outcomes import FloatArray
from comparisons.experiments.stability.harness.steps import any_turn, orthogonal, scaled
from comparisons.geometry.frame import round32
from reference_rt.core import transform

SHAPES = 8
"""Drawn at each sweep point."""

OUTSIDE = 0.25
"""The share of rays that are aimed beyond an edge."""


@dataclass(frozen=True)
class Trial:
    """A shape of the scene and rays o, d (n, 3);  size: its largest extent;  singles: whether
    float32 has all numbers;  corners: of a triangle (3, 3), of a box along the axes the lower and
    upper one (2, 3), else none."""

    kind: str
    shape: Any
    o: FloatArray
    d: FloatArray
    size: float
    singles: bool
    corners: FloatArray | None = None


def _turn(rng: np.random.Generator, turned: bool) -> FloatArray:
    """A rotation (3, 3): any, or one that permutes the axes."""
    return orthogonal(rng) if turned else np.asarray(np.eye(3)[rng.permutation(3)])


def barycentrics(rng: np.random.Generator, n: int) -> FloatArray:
    """Of points (n, 3) of a triangle's plane, some beyond the edge across from a vertex."""
    inside = rng.dirichlet((1.0, 1.0, 1.0), n)
    beyond, share = -rng.uniform(0.0, 0.5, n), rng.uniform(0.0, 1.0, n)
    outside = np.stack([beyond, (1.0 - beyond) * share, (1.0 - beyond) * (1.0 - share)], axis=1)
    which = rng.uniform(size=(n, 1)) < OUTSIDE
    turn = rng.integers(0, 3)
    return np.asarray(np.where(which, np.roll(outside, turn, axis=1), inside))


def _triangle(v: FloatArray, o: FloatArray, d: FloatArray, singles: bool) -> Trial:
    if singles:
        v, o, d = round32(v), round32(o), round32(d)
    a, b, c = (tuple(x) for x in v.tolist())
    size = float(np.linalg.norm(v - np.roll(v, 1, axis=0), axis=1).max())
    return Trial("triangles", rt.Triangle(v0=a, v1=b, v2=c), o, d, size, singles, v)


def thin_triangle(
    rng: np.random.Generator,
    aspect: float,
    n: int,
    singles: bool,
    turned: bool,
    aim: FloatArray | None = None,
) -> Trial:
    """Height 1 / aspect over an edge of length 2, met at up to 70 degrees from the normal.

    Aligned, rays run along the edge and down: across it they start and move by heights alone.
    aim (n, 3): barycentrics of what rays are aimed at, any by default.
    """
    foot = rng.uniform(-0.8, 0.8)
    v = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [foot, 1.0 / aspect, 0.0]])
    turn = _turn(rng, turned)
    targets = (barycentrics(rng, n) if aim is None else aim) @ v
    sideways = np.array([1.0, 1.0 if turned else 1.0 / aspect, 0.0])
    slant = 2.0 * rng.uniform(-1.0, 1.0, (n, 3)) * sideways
    slant += rng.choice([-1, 1], (n, 1)) * [0, 0, 1]
    d = slant * rng.uniform(1.0, 4.0, (n, 1))
    return _triangle(v @ turn.T, (targets - d) @ turn.T, d @ turn.T, singles)


def grazed_triangle(
    rng: np.random.Generator,
    inverse_angle: float,
    n: int,
    singles: bool,
    turned: bool,
    aim: FloatArray | None = None,
) -> Trial:
    """A triangle that is nowhere thin, and rays at an angle to its plane;  aim: as above."""
    angles = 2.0 * np.pi * (np.arange(3) / 3.0) + rng.uniform(-0.4, 0.4, 3)
    v = np.stack([np.cos(angles), np.sin(angles), np.zeros(3)], axis=1)
    turn = _turn(rng, turned)
    d = grazing_directions(rng, inverse_angle, n)
    targets = (barycentrics(rng, n) if aim is None else aim) @ v
    return _triangle(v @ turn.T, (targets - d) @ turn.T, d @ turn.T, singles)


def grazing_directions(rng: np.random.Generator, inverse_angle: float, n: int) -> FloatArray:
    """Directions (n, 3) that fall or rise by 1 / inverse_angle, 1 to 4 long."""
    phi = rng.uniform(0.0, 2.0 * np.pi, n)
    rise = rng.choice([-1.0, 1.0], n) / inverse_angle
    d = np.stack([np.cos(phi), np.sin(phi), rise], axis=1)
    return np.asarray(d * rng.uniform(1.0, 4.0, (n, 1)))


def grazed_flat(
    rng: np.random.Generator, inverse_angle: float, n: int, singles: bool, is_round: bool
) -> Trial:
    """A rectangle or ellipse of half sizes 1 and 0.5: aimed at points inside, and around it."""
    x, y = rng.uniform(-1.0, 1.0, (2, n)) * np.where(rng.uniform(size=n) < OUTSIDE, 1.5, 0.7)
    d = grazing_directions(rng, inverse_angle, n)
    o = np.stack([x, 0.5 * y, np.zeros(n)], axis=1) - d
    steps: tuple[transform.Step, ...] = (scaled(1.0, 0.5, 1.0),)
    if singles:
        o, d = round32(o), round32(d)
    else:
        steps += (any_turn(rng),)
        m = transform.affine(steps[1:])[:, :3]
        o, d = o @ m.T, d @ m.T
    if is_round:
        return Trial("disks", rt.Disk(transform=steps), o, d, 2.0, singles)
    return Trial("rectangles", rt.Rectangle(transform=steps), o, d, 2.0, singles)

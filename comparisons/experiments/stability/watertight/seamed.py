"""Closed surfaces that are no meshes: rays in them, at where their parts meet."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.meshes import AWAY
from comparisons.experiments.stability.harness.outcomes import FloatArray, Outcome, outcome
from comparisons.experiments.stability.harness.steps import any_turn, at
from comparisons.geometry.affine import unit_vectors
from reference_rt.core import transform
from reference_rt.core.arrays import IntArray

APART = 10.0
"""Between the middles of neighbours, none of which is larger than 2."""


@dataclass(frozen=True)
class Seamed:
    """make(steps): the shape under a transform;  insides (k, 3): rays start within 0.05 of these;
    seams(rng, n): points (n, 3) of edges;  translated: whether Mitsuba has it as it is."""

    make: Callable[[tuple[transform.Step, ...]], Any]
    insides: FloatArray
    seams: Callable[[np.random.Generator, int], FloatArray]
    translated: bool = False


def _circle(rng: np.random.Generator, n: int, radius: float, z: FloatArray) -> FloatArray:
    phi = rng.uniform(0.0, 2.0 * np.pi, n)
    return np.stack([radius * np.cos(phi), radius * np.sin(phi), rng.choice(z, n)], axis=1)


def _box_edges(rng: np.random.Generator, n: int) -> FloatArray:
    """Corners among them."""
    p = rng.choice([-1.0, 1.0], (n, 3))
    free = rng.integers(0, 4, n)
    some = free < 3
    p[np.flatnonzero(some), free[some]] = rng.uniform(-1.0, 1.0, int(some.sum()))
    return p


def _sphere_on_box(radius: float) -> Callable[[np.random.Generator, int], FloatArray]:
    """The circles in which a sphere cuts the faces of the box."""

    def seams(rng: np.random.Generator, n: int) -> FloatArray:
        p = _circle(rng, n, np.sqrt(radius**2 - 1.0), np.array([-1.0, 1.0]))
        turn = np.array([[0, 1, 2], [1, 2, 0], [2, 0, 1]])[rng.integers(0, 3, n)]
        return np.take_along_axis(p, turn, axis=1)

    return seams


_RING = np.array([[np.cos(a), np.sin(a), 0.0] for a in np.linspace(0.0, 6.0, 7)])
_CORNERS = 0.9 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
_MIDDLE = np.zeros((1, 3))
_UP = np.array([[0.0, 0.0, 1.0]])

KINDS: dict[str, Seamed] = {
    "box": Seamed(lambda t: rt.Box(transform=t), _MIDDLE, _box_edges, translated=True),
    "sphere": Seamed(
        lambda t: rt.Sphere(transform=t), _MIDDLE, lambda rng, n: unit_vectors(rng, n)
    ),
    "cylinder": Seamed(
        lambda t: rt.Cylinder(transform=t),
        0.5 * _UP,
        lambda rng, n: _circle(rng, n, 1.0, np.array([0.0, 1.0])),
        translated=True,
    ),
    "cone": Seamed(
        lambda t: rt.Cone(transform=t),
        0.3 * _UP,
        lambda rng, n: np.where(
            rng.uniform(size=(n, 1)) < 0.1, [0.0, 0.0, 1.0], _circle(rng, n, 1.0, np.zeros(1))
        ),
    ),
    "torus": Seamed(
        lambda t: rt.Torus(major_radius=1.0, minor_radius=0.4, transform=t),
        _RING,
        lambda rng, n: _circle(rng, n, 1.0, np.array([-0.4, 0.4])),
    ),
    "union": Seamed(
        lambda t: rt.Union(of=(rt.Sphere(), rt.Sphere(center=(0.0, 0.0, 1.0))), transform=t),
        0.5 * _UP,
        lambda rng, n: _circle(rng, n, np.sqrt(0.75), np.array([0.5])),
    ),
    "intersection": Seamed(
        lambda t: rt.Intersection(of=(rt.Box(), rt.Sphere(radius=1.2)), transform=t),
        _MIDDLE,
        _sphere_on_box(1.2),
    ),
    "difference": Seamed(
        lambda t: rt.Difference(of=(rt.Box(), rt.Sphere(radius=1.2)), transform=t),
        _CORNERS,
        _sphere_on_box(1.2),
    ),
}


@dataclass(frozen=True)
class Case:
    """Shapes and rays (n, 3) that start in shape `whose` (n,)."""

    shapes: tuple[Any, ...]
    o: FloatArray
    d: FloatArray
    whose: IntArray


def drawn(rng: np.random.Generator, names: tuple[str, ...], offset: float, n: int) -> Case:
    """n rays of each of these kinds: half in random directions, half at the seams."""
    shapes, origins, directions = [], [], []
    for k, name in enumerate(names):
        kind = KINDS[name]
        middle = offset * AWAY + [APART * k, 0.0, 0.0]
        steps = (any_turn(rng), at(*middle.tolist()))
        shapes.append(kind.make(steps))
        m = transform.affine(steps[:1])[:, :3]
        stray = rng.uniform(-1.0, 1.0, (n, 3)) * 0.05 / np.sqrt(3.0)
        inside = kind.insides[rng.integers(0, len(kind.insides), n)] + stray
        o = inside @ m.T + middle
        half = n // 2
        aimed = kind.seams(rng, half) @ m.T + middle - o[:half]
        origins.append(o)
        directions.append(np.concatenate([aimed, unit_vectors(rng, n - half)]))
    whose = np.repeat(np.arange(len(names)), n)
    return Case(tuple(shapes), np.concatenate(origins), np.concatenate(directions), whose)


def judged(case: Case, hits: Any) -> Outcome:
    """Whether each ray meets the shape that it starts in."""
    shown = {
        "shape": lambda k: case.shapes[case.whose[k]].model_dump_json(exclude_defaults=True),
        "origin": case.o,
        "direction": case.d,
        "expected": "a hit of the shape",
        "found": lambda k: f"shape {hits.shape[k]} at t = {hits.t[k]}",
    }
    return outcome(hits.shape != case.whose, shown)

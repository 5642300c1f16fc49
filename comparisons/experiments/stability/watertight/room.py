"""A closed mesh from inside, under a bright sky: leaks are white."""

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.meshes import Closed, cube
from comparisons.experiments.stability.harness.outcomes import OURS, FloatArray
from comparisons.experiments.stability.harness.shots import Shot
from comparisons.experiments.stability.watertight.tracers import by_method, crossings, mitsubas

SQUARES, PIXELS = 8, 193
"""A face has so many squares, and a picture so many pixels: every 24th row runs along edges."""

TURN = np.linalg.qr(np.array([[3.0, 1.0, 4.0], [1.0, 5.0, 9.0], [2.0, 6.0, 5.0]]))[0]
"""The room's: along the axes all numbers would be round, and nothing would leak."""


def room() -> Closed:
    """The cube that is seen: its edges, and the squares' diagonals, run through pixels' middles."""
    straight = cube(SQUARES)
    return Closed("room", straight.vertices @ TURN.T, straight.faces, straight.insides)


def view() -> tuple[FloatArray, FloatArray]:
    """Rays (n, 3) from a point inside, evenly over one face."""
    at = np.arange(PIXELS) / (0.5 * (PIXELS - 1)) - 1.0
    y, x = np.meshgrid(-at, at, indexing="ij")
    seen = np.stack([x.ravel(), y.ravel(), -np.ones(x.size)], axis=1)
    o = np.tile([0.137, -0.219, 0.083], (len(seen), 1))
    return o @ TURN.T, (seen - o) @ TURN.T


def shot(contestant: str, _x: float) -> Shot:
    """The walls grey by their squares, the sky white: no pixel may be."""
    mesh = room()
    o, d = view()
    if contestant == OURS:
        number, _ = crossings(_tables(mesh), o, d)
        hit = number > 0
    elif contestant.startswith("mitsuba"):
        hit = mitsubas(mesh)[contestant](o, d)
    else:
        hit = by_method(contestant, mesh)(o, d)
    seen = (o + d) @ TURN
    chequered = np.floor((seen[:, :2] + 1.0 + 1e-9) * 0.5 * SQUARES).sum(axis=1) % 2.0
    grey = np.where(hit, np.where(chequered == 0.0, 40, 64), 255)
    pixels = np.repeat(grey.reshape(PIXELS, PIXELS, 1), 3, axis=2).astype(np.uint8)
    return Shot(pixels, f"A closed cube from inside: {int((~hit).sum())} pixels see the sky.")


def _tables(mesh: Closed) -> rt.SceneTables:
    corners = mesh.vertices[mesh.faces].tolist()
    return rt.build_tables(
        rt.Scene(shapes=tuple(rt.Triangle(v0=a, v1=b, v2=c) for a, b, c in corners))
    )

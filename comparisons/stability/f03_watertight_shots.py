"""A closed mesh from inside, under a bright sky: what leaks is white."""

import numpy as np

import reference_rt as rt
from comparisons.stability.f03_watertight_meshes import Closed, cube
from comparisons.stability.f03_watertight_tracers import by_method, crossings, mitsubas
from comparisons.stability.family import OURS, FloatArray, Shot

SQUARES, PIXELS = 8, 193
"""A face has so many squares, and a picture so many pixels: every 24th row runs along edges."""


def room() -> Closed:
    """The cube that is seen."""
    return cube(SQUARES)


def view() -> tuple[FloatArray, FloatArray]:
    """Rays (n, 3) of a camera in the middle that sees one face, 90 degrees across."""
    at = np.arange(PIXELS) / (0.5 * (PIXELS - 1)) - 1.0
    y, x = np.meshgrid(-at, at, indexing="ij")
    d = np.stack([x.ravel(), y.ravel(), -np.ones(x.size)], axis=1)
    return np.zeros_like(d), d


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
    chequered = np.floor((d[:, :2] + 1.0) * 0.5 * SQUARES).sum(axis=1) % 2.0
    grey = np.where(hit, np.where(chequered == 0.0, 40, 64), 255)
    pixels = np.repeat(grey.reshape(PIXELS, PIXELS, 1), 3, axis=2).astype(np.uint8)
    return Shot(pixels, f"A closed cube from inside: {int((~hit).sum())} pixels see the sky.")


def _tables(mesh: Closed) -> rt.SceneTables:
    corners = mesh.vertices[mesh.faces].tolist()
    return rt.build_tables(
        rt.Scene(shapes=tuple(rt.Triangle(v0=a, v1=b, v2=c) for a, b, c in corners))
    )

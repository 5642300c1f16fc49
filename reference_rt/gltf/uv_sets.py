"""Textures by several sets of texture coordinates.

A mesh of ours has one set.  On each triangle any other set is an affine map of it, and a texture
has such a map: so a primitive is cut into pieces of triangles with the same map, each with its own
material.  A set that is a copy, or another scale, is one piece; charts that were moved and turned
are one each.
"""

from typing import NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray, IntArray

MOST_PIECES = 64
"""Pieces up to which a primitive is cut: of surfaces that were unwrapped twice, each triangle would
be one."""

ROUNDING = 2.0**-19
"""By how much a map may miss, per unit of the coordinates: these are rounded to float32, 2^-24, and
of the largest triangle of a piece its map makes that a few times as much; a texel is 2^-14."""

Map = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Two rows, of (u, v, 1)."""

Maps = tuple[tuple[int, Map], ...]
"""By number of a set, what makes it of the first set."""


class Piece(NamedTuple):
    """faces: numbers of triangles (m,);  maps: of these."""

    faces: IntArray
    maps: Maps


def pieces(first: FloatArray, others: dict[int, FloatArray]) -> list[Piece] | None:
    """Pieces of a primitive, the largest map first; None where they are too many.

    first, others: texture coordinates (m, 3, 2) at the corners of triangles, the others by the
    numbers of their sets.
    """
    known = np.concatenate([first, np.ones((*first.shape[:2], 1))], axis=2)
    wanted = np.concatenate([*others.values()], axis=2)
    if not (np.isfinite(known).all() and np.isfinite(wanted).all()):
        return None
    area, allowed = np.abs(np.linalg.det(known)), ROUNDING * max(1.0, np.abs(wanted).max())
    left, found = np.arange(len(first)), list[Piece]()
    while len(left):
        pivot = left[int(area[left].argmax())]
        m = np.linalg.lstsq(known[pivot], wanted[pivot], rcond=None)[0]
        fits = (np.abs(known[left] @ m - wanted[left]) <= allowed).all(axis=(1, 2))
        if len(found) == MOST_PIECES or pivot not in left[fits]:
            return None
        maps = tuple((n, _rows(m[:, 2 * k : 2 * k + 2])) for k, n in enumerate(others))
        found.append(Piece(left[fits], maps))
        left = left[~fits]
    return found


def _rows(m: FloatArray) -> Map:
    """A map without the rounding of numbers that are whole: of a copy, the identity."""
    near = np.round(m)
    (a, b), (c, d), (e, f) = np.where(np.abs(m - near) <= ROUNDING, near, m).tolist()
    return (a, c, e), (b, d, f)

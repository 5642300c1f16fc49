"""Triangles clipped along the zeros of a function."""

from collections.abc import Callable

import numpy as np

from reference_rt.core.arrays import FloatArray, IntArray


def cut_away(
    data: FloatArray, faces: IntArray, height: Callable[[FloatArray], FloatArray]
) -> tuple[FloatArray, IntArray]:
    """Triangles (m, 3) of vertices (n, k), clipped to where `height` of the vertices is at most 0
    (Sutherland & Hodgman 1974).

    An edge is cut at the zero of the quadratic through its heights at both ends and the middle.
    """
    h = height(data)
    inside = h[faces] <= 0.0
    count = inside.sum(axis=1)
    kept, added = [faces[count == 3]], [data]
    start = len(data)
    for lone_inside in (True, False):
        mine = count == (1 if lone_inside else 2)
        if not mine.any():
            continue
        # Rotated so that the corner that is alone on its side comes first.
        first = np.argmax(inside[mine] if lone_inside else ~inside[mine], axis=1)
        turned = np.take_along_axis(faces[mine], (first[:, None] + [0, 1, 2]) % 3, axis=1)
        a, b, c = turned.T
        ends = []
        for other in (b, c):
            middle = height(0.5 * (data[a] + data[other]))
            t = _zero(h[a], middle, h[other])[:, None]
            added.append(data[a] + (data[other] - data[a]) * t)
            ends.append(start + np.arange(len(a)))
            start += len(a)
        on_ab, on_ac = ends
        if lone_inside:
            kept.append(np.column_stack([a, on_ab, on_ac]))
        else:
            kept += [np.column_stack([on_ab, b, c]), np.column_stack([on_ab, c, on_ac])]
    return np.concatenate(added), np.concatenate(kept)


def _zero(at0: FloatArray, middle: FloatArray, at1: FloatArray) -> FloatArray:
    """The zero in [0, 1] of the quadratic with these values at 0, 1/2 and 1; the values at the ends
    have opposite signs."""
    a = 2.0 * (at0 - 2.0 * middle + at1)
    b, c = at1 - at0 - a, at0
    with np.errstate(divide="ignore", invalid="ignore"):
        q = -0.5 * (b + np.copysign(np.sqrt(np.maximum(b * b - 4.0 * a * c, 0.0)), b))
        roots = np.stack([q / a, c / q])
    # Of the two roots the one in [0, 1], or the nearest.
    outside = np.abs(np.nan_to_num(roots, nan=np.inf) - 0.5)
    chosen = np.take_along_axis(roots, outside.argmin(axis=0)[None], axis=0)[0]
    return np.asarray(np.clip(np.nan_to_num(chosen, nan=0.5), 0.0, 1.0))

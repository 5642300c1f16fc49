"""Spatial splits: primitives are cut at a plane where sorting them leaves children that overlap
(Stich, Friedrich & Dietrich 2009, "Spatial splits in bounding volume hierarchies", HPG)."""

from typing import NamedTuple

import numpy as np

from reference_rt.accel.bvh.bins import (
    ALL_BINS,
    BINS,
    Bins,
    Split,
    bin_of,
    bins_per_unit,
    cheapest_plane,
    no_split,
)
from reference_rt.accel.bvh.nodes import (
    assign,
    center,
    clear,
    half_area,
    is_empty,
    joint_half_area,
    merge,
    swap,
)
from reference_rt.core.arrays import FloatArray, IdArray
from reference_rt.core.ray import UNIT_ROUNDOFF
from reference_rt.jit.kernel import kernel
from reference_rt.jit.simd import VECTOR_WIDTH

MOST_REFERENCES = 2
"""The most references, as a multiple of the number of primitives."""
CUT_FROM = 16
"""Nodes with fewer references are not cut: cuts gain least there, and would use up the room for
references that others need (measured on 200 long strips across a plane: SAH cost 41 with this
limit, 64 with 2, 62 without cuts)."""
OVERLAP = 1e-5
"""Nodes whose children overlap in less than this fraction of the root's area are not cut either:
the paper's alpha."""

CUT_ERROR = 16.0 * UNIT_ROUNDOFF
"""A bound on the rounding of p + t (q - p), t = (plane - a) / (b - a) in [0, 1], relative to
m = max(|p|, |q|): five roundings of what is at most 2 m, that of the sum and that of adding the
bound make 12 u m; 4 are for products of roundings.  What underflow adds is smaller than the
smallest normal number."""
SMALLEST_NORMAL = 2.0**-1022


class Parts(NamedTuple):
    """Scratch boxes: of one reference's two parts and of the whole reference; of the two children
    so far."""

    left: FloatArray
    right: FloatArray
    whole: FloatArray
    left_node: FloatArray
    right_node: FloatArray


def new_parts() -> Parts:
    """Uninitialised scratch."""
    return Parts(*np.empty((5, 6)))


@kernel
def _plane_after(low: float, high: float, b: int) -> float:
    """The plane at the end of bin b."""
    return low + (b + 1) * ((high - low) / BINS)


@kernel
def _limit(box: FloatArray, by: FloatArray) -> None:
    """Intersects `box` with `by`; the empty box where they do not meet."""
    for k in range(3):
        box[k] = max(box[k], by[k])
        box[3 + k] = min(box[3 + k], by[3 + k])
    if is_empty(box):
        clear(box)


# ---- choice of the plane: an estimate, whose rounding affects only speed ------------------------


@kernel
def is_worth_a_try(
    refs: FloatArray,
    begin: int,
    end: int,
    centers: FloatArray,
    split: Split,
    root: FloatArray,
    parts: Parts,
) -> bool:
    """Whether a node has at least CUT_FROM references, and the children of its best object split
    overlap."""
    if end - begin < CUT_FROM:
        return False
    if split.axis < 0:
        return True
    a = split.axis
    low, scale = centers[a], bins_per_unit(centers[a], centers[VECTOR_WIDTH + a])
    clear(parts.left_node)
    clear(parts.right_node)
    for k in range(begin, end):
        if bin_of(center(refs[k], a), low, scale) <= split.bin:
            merge(parts.left_node, refs[k])
        else:
            merge(parts.right_node, refs[k])
    _limit(parts.left_node, parts.right_node)
    return half_area(parts.left_node) > OVERLAP * half_area(root)


@kernel
def _mark(
    box: FloatArray, ref: FloatArray, corners: FloatArray, i: int, p: int, q: int, t: float
) -> None:
    """Grows `box` by the point at t from corner p to corner q, clamped to the reference's box."""
    for k in range(3):
        x = corners[i, p + k] + t * (corners[i, q + k] - corners[i, p + k])
        x = max(ref[k], min(ref[3 + k], x))
        box[k] = min(box[k], x)
        box[3 + k] = max(box[3 + k], x)


@kernel
def _fill_bins(
    corners: FloatArray, i: int, ref: FloatArray, axis: int, low: float, high: float, bins: Bins
) -> None:
    """Adds a reference to the bins that it overlaps: slices of its box, or for a triangle its
    corners and the points where its edges cross the planes between bins and leave the box."""
    boxes, scale = bins.boxes[axis], bins_per_unit(low, high)
    first, last = bin_of(ref[axis], low, scale), bin_of(ref[3 + axis], low, scale)
    bins.enter[axis, first] += 1
    bins.leave[axis, last] += 1
    if first == last:
        merge(boxes[first], ref)
    elif np.isnan(corners[i, 0]):
        for b in range(first, last + 1):
            for k in range(3):
                start = _plane_after(low, high, b - 1) if k == axis and b > first else ref[k]
                stop = _plane_after(low, high, b) if k == axis and b < last else ref[3 + k]
                boxes[b, k] = min(boxes[b, k], start)
                boxes[b, 3 + k] = max(boxes[b, 3 + k], stop)
    else:
        for p in range(0, 9, 3):
            q = (p + 3) % 9
            x, y = corners[i, p + axis], corners[i, q + axis]
            if ref[axis] <= x <= ref[3 + axis]:
                _mark(boxes[bin_of(x, low, scale)], ref, corners, i, p, p, 0.0)
            start, stop = max(ref[axis], min(x, y)), min(ref[3 + axis], max(x, y))
            if start < stop:
                inverse = 1.0 / (y - x)
                if min(x, y) < start:
                    _mark(boxes[first], ref, corners, i, p, q, (start - x) * inverse)
                if max(x, y) > stop:
                    _mark(boxes[last], ref, corners, i, p, q, (stop - x) * inverse)
                for b in range(bin_of(start, low, scale), bin_of(stop, low, scale)):
                    t = (_plane_after(low, high, b) - x) * inverse
                    _mark(boxes[b], ref, corners, i, p, q, t)
                    _mark(boxes[b + 1], ref, corners, i, p, q, t)


@kernel
def best_cut(
    corners: FloatArray,
    refs: FloatArray,
    ids: IdArray,
    begin: int,
    end: int,
    spare: int,
    box: FloatArray,
    bins: Bins,
    side: FloatArray,
) -> Split:
    """The cheapest plane between bins of the node's box that makes at most `spare` more
    references."""
    best = no_split()
    for axis in range(3):
        low, high = box[axis], box[3 + axis]
        if bins_per_unit(low, high) > 0.0:
            for k in range(begin, end):
                _fill_bins(corners, ids[k], refs[k], axis, low, high, bins)
            split = cheapest_plane(bins, axis, ALL_BINS, bins.leave, end - begin, spare, side)
            if split.cost < best.cost:
                best = split
    return best


# ---- the cut itself: its boxes must be conservative ---------------------------------------------


@kernel
def _grow_to_crossing(
    box: FloatArray, corners: FloatArray, i: int, p: int, q: int, t: float
) -> None:
    """Grows `box` by the point at t from corner p to corner q and its rounding error; by the whole
    edge where differences overflow."""
    for k in range(3):
        a, b = corners[i, p + k], corners[i, q + k]
        low, high = min(a, b), max(a, b)
        x = a + t * (b - a)
        error = CUT_ERROR * max(abs(a), abs(b)) + SMALLEST_NORMAL
        box[k] = min(box[k], x - error if low < x - error <= high else low)
        box[3 + k] = max(box[3 + k], x + error if low <= x + error < high else high)


@kernel
def cut(
    corners: FloatArray, i: int, box: FloatArray, axis: int, plane: float, parts: Parts
) -> None:
    """Computes parts.left and parts.right: boxes, perhaps empty, of the parts of primitive i inside
    `box` on either side of a plane.  A triangle's part is the hull of its corners on that side,
    which are exact, and of its edges' crossings with the plane, whose error CUT_ERROR bounds."""
    left, right = parts.left, parts.right
    clear(left)
    clear(right)
    if np.isnan(corners[i, 0]):
        merge(left, box)
        merge(right, box)
    else:
        for p in range(0, 9, 3):
            q = (p + 3) % 9
            a, b = corners[i, p + axis], corners[i, q + axis]
            if a <= plane:
                _grow_to_crossing(left, corners, i, p, p, 0.0)
            if a >= plane:
                _grow_to_crossing(right, corners, i, p, p, 0.0)
            if min(a, b) < plane < max(a, b):
                t = (plane - a) / (b - a) if abs(b - a) < np.inf else np.nan
                _grow_to_crossing(left, corners, i, p, q, t)
                _grow_to_crossing(right, corners, i, p, q, t)
    left[3 + axis] = min(left[3 + axis], plane)
    right[axis] = max(right[axis], plane)
    _limit(left, box)
    _limit(right, box)


@kernel
def cut_all(
    corners: FloatArray,
    refs: FloatArray,
    ids: IdArray,
    begin: int,
    end: int,
    box: FloatArray,
    split: Split,
    parts: Parts,
) -> tuple[int, int]:
    """Reorders references, the right child's first, then the left's; those across the plane are cut
    and are in both.  Returns (index of the left child's first one, new end).  All may come to one
    side: then none is cut."""
    axis = split.axis
    low, high = box[axis], box[3 + axis]
    scale, plane = bins_per_unit(low, high), _plane_after(low, high, split.bin)
    whole, left_node, right_node = parts.whole, parts.left_node, parts.right_node
    clear(left_node)
    clear(right_node)
    # In order: right [begin, right), across the plane [right, k), not yet sorted [k, left), left
    # [left, end).  Sorted by bins, not by the plane, so that as many are across as were counted
    # when it was chosen.
    right, left, k = begin, end, begin
    while k < left:
        if bin_of(refs[k, axis], low, scale) > split.bin:
            merge(right_node, refs[k])
            swap(refs, ids, k, right)
            right += 1
            k += 1
        elif bin_of(refs[k, 3 + axis], low, scale) <= split.bin:
            merge(left_node, refs[k])
            left -= 1
            swap(refs, ids, k, left)
        else:
            cut(corners, ids[k], refs[k], axis, plane, parts)
            merge(left_node, parts.left)
            merge(right_node, parts.right)
            k += 1
    # The paper's reference unsplitting: uncut in one child, where that is cheaper than cut in both.
    n_left, n_right = end - right, left - begin
    while right < left:
        i = ids[right]
        assign(whole, refs[right])
        cut(corners, i, whole, axis, plane, parts)
        area_left, area_right = half_area(left_node), half_area(right_node)
        both = area_left * n_left + area_right * n_right
        only_left = joint_half_area(left_node, whole) * n_left + area_right * (n_right - 1)
        only_right = area_left * (n_left - 1) + joint_half_area(right_node, whole) * n_right
        if is_empty(parts.left) or only_right < min(both, only_left):
            merge(right_node, whole)
            n_left -= 1
            right += 1
        elif is_empty(parts.right) or only_left < both:
            merge(left_node, whole)
            n_right -= 1
            left -= 1
            swap(refs, ids, right, left)
        else:
            assign(refs[right], parts.right)
            assign(refs[end], parts.left)
            ids[end] = i
            right += 1
            end += 1
    return right, end

"""The pixels of a picture without noise, whose edges may be sampled as a rasteriser does.

A rasteriser decides by a few points of a pixel what it shows, so a pixel on an edge may have any
value that its footprint sees. Each pixel that differs, and each that an edge crosses, is looked at
with NODES x NODES rays. Their spacing is SNAP: a surface may be a node away from its place.

- *Inside* pixels, whose radiance has no step, are exact: the candidate has the reference's value,
  or one that samples of RULES have which are each within SNAP of their places.
- *Edge* pixels have a step: from one node to the next the radiance changes by STEP of its range. It
  may be a silhouette, a crease, the border of a texel or a shadow, or one of these in a mirror; a
  step that no radiance shows needs no forgiveness. The candidate is within the range of what the
  footprint sees, in each channel.
- *All edges* together are sampled about the centres of their pixels, by the one of RULES that
  explains the candidate best. What it leaves, as a share of each pixel's contrast, is MOST_LEFT in
  no more pixels than CHOICES, and has no mean along one of MODES: a mean beyond MARGIN and
  STANDARD_ERRORS is a bias. What only the pixels around see, as the tip of a triangle that was
  moved, counts among CHOICES.

These intervals are widened by the tolerance, relative to the value, and for pictures of 8 bits by
half a code.  A picture that takes the reference's own samples needs no such forgiveness, and has
none: see `own_samples`.

Pictures that went through a tone curve are judged as displayed, so is what footprints see.
Renderers average samples before the curve, after it, or as the codes that are stored: each is a
rule.  Of curves that mix channels an average may be none of what it is made of, so the range of a
footprint has what mixtures of any two of its extremes show.

Contract: pictures are linear (height, width, 3), row 0 on top, the reference after the tone curve.
A `Look` takes points (..., 2), in pixels to the right and down from the picture's top left corner,
and returns radiance before the curve.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from comparisons.results.case import FloatArray, RungResult
from comparisons.rungs.footprints import Look
from comparisons.rungs.own_samples import SNAP as OWN_SNAP
from comparisons.rungs.own_samples import are_seen, permitted, strays
from comparisons.statistics.cells import CHANNELS
from reference_rt.rendering.image import srgb
from reference_rt.textures.image_file import linear

BoolArray = npt.NDArray[np.bool_]

TOLERANCE = 1e-3
"""Relative error of a value: twice the rounding of a half float, 2^-11.  Values of float32 need
1e-5 (measured with three.js in Chromium's software rasteriser)."""

DARK = 0.1
"""Errors are relative to a value, or to this fraction of the channel's mean if that is larger."""

SNAP = 1.0 / 16.0
"""Pixels.  Vulkan and OpenGL require four bits of sub-pixel precision: vertices, and with them
edges and all that is interpolated, move by 1/32 if they are rounded to that grid, by 1/16 if cut
off.  Direct3D has eight bits."""

REACH = 9
"""Nodes to each side of the centre: to the border of the pixel, and beyond by SNAP."""

NODES = 2 * REACH + 1

STEP = 1.0 / 8.0
"""Of the footprint's range.  From node to node a linear function changes by 1/18 of it, a parabola
with its vertex in the picture by 1/9."""

COARSE = 3.0 / 4.0
"""The same for three nodes, which choose the pixels to look at; half for linear functions."""

MOST = 1 << 16
"""Pixels that are looked at, evenly chosen if there are more: 2.4e7 rays.  If a share of 1e-4 were
wrong, these would have one with a probability of 99.9 %."""

AROUND = 48
"""Nodes, half of SNAP apart, to each side of the centre that take in the pixels around.  The tip of
a triangle is thinner than SNAP, and may be on a sample once it is moved."""

MOST_TIPS = 1 << 8
"""Pixels that are looked at so: a picture with more has other faults, and none is looked at."""

CHOICES = 0.02
"""Share of edge pixels, or one of them, of which a rule may leave MOST_LEFT, or that show what only
the pixels around them see.  A shift by a quarter of a pixel leaves 4 to 8 %."""

MOST_LEFT = 0.75
"""Of the contrast.  One sample at the centre is a rule, and leaves nothing; two or more around the
centre are off by half of it where they are all on one side of an edge."""

MARGIN = 0.01
"""Permitted bias, in pixels or shares of the contrast.  The smallest coverage of the nodes, half of
SNAP, is within what each rule permits already."""

STANDARD_ERRORS = 6.0
"""Of a mode's mean, where pixels of equal coverage and direction count as one: an edge along an
axis is sampled alike in all its pixels.  Of 2,000 right pictures the most was 5.1."""

MODES = ("shift in x", "shift in y", "growth of what is near", "brightness")

RULES: dict[str, npt.NDArray[np.int64]] = {
    name: np.array(at, np.int64)
    for name, at in {
        "one sample at the centre": [(0, 0)],
        "2 samples": [(4, 4), (-4, -4)],
        "4 samples": [(-2, -6), (6, -2), (-6, 2), (2, 6)],
        "8 samples": [(1, -3), (-1, 3), (5, 1), (-3, -5), (-5, 5), (-7, -1), (3, 7), (7, -7)],
        "2 x 2 samples": [(x, y) for y in (-4, 4) for x in (-4, 4)],
        "4 x 4 samples": [(x, y) for y in (-6, -2, 2, 6) for x in (-6, -2, 2, 6)],
        "area": [(x, y) for y in range(-7, 8, 2) for x in range(-7, 8, 2)],
    }.items()
}
"""How pixels may be sampled, in sixteenths of a pixel to the right and down.  2, 4 and 8 samples
are those of Direct3D and Vulkan."""

SPACES = ("", ", averaged after the tone curve", ", averaged as codes")
"""Where samples are averaged: linear ones, and where there is a tone curve also displayed ones."""

CHORD = np.arange(1, 8) / 8.0
"""Shares of two values in mixtures.  A parabola that has its vertex between is off by 1/256 of its
height."""

Curve = Callable[[FloatArray], FloatArray]


class Edges(NamedTuple):
    """What a gate knows of the footprints of pixels;  tolerance: relative error of a value, after
    the tone curve;  floor (3,): the values to which it is relative at least, where there is one;
    samples (k, 2): the places of the reference's in a pixel, where they are known;  beside: what
    pixels of these samples see that may also be right (`own_samples.uncut`);  others: pictures of
    mistaken trees, by name, which are rendered if they are needed."""

    look: Look
    tolerance: float = TOLERANCE
    curve: Curve | None = None
    floor: FloatArray | None = None
    samples: FloatArray | None = None
    beside: Sequence[Look] = ()
    others: Callable[[], list[tuple[str, FloatArray]]] | None = None

    def without_rim(self, pixels: int) -> "Edges":
        def moved(look: Look) -> Look:
            return lambda points: look(points + pixels)

        return self._replace(look=moved(self.look), beside=tuple(map(moved, self.beside)))


class _Law(NamedTuple):
    """floor (3,): the values to which errors are relative at least;  displayed: 8-bit sRGB;  curve:
    the tone curve."""

    tolerance: float
    floor: FloatArray
    displayed: bool
    curve: Curve | None

    def shown(self, radiance: FloatArray) -> FloatArray:
        return radiance if self.curve is None else self.curve(radiance)

    def with_mixtures(self, radiance: FloatArray, *bounds: FloatArray) -> tuple[FloatArray, ...]:
        """The bounds (2, n, 3) of what nodes (n, y, x, 3) show, and of what mixtures of those nodes
        show that are the least or the largest of a channel."""
        if self.curve is None:
            return bounds
        nodes = radiance.reshape(len(radiance), -1, 3)
        ends = np.concatenate([nodes.argmin(axis=1), nodes.argmax(axis=1)], axis=1)
        ends = np.take_along_axis(nodes, ends[..., None], axis=1)
        i, j = np.triu_indices(ends.shape[1], 1)
        a, b = ends[:, i, None], ends[:, j, None]
        mixed = self.curve(a + CHORD[:, None] * (b - a)).reshape(len(nodes), -1, 3)
        return np.minimum(bounds[0], mixed.min(axis=1)), np.maximum(bounds[1], mixed.max(axis=1))

    def by_rules(self, radiance: FloatArray, shown: FloatArray) -> tuple[list[FloatArray], ...]:
        """The least and the largest (n, 3) that each of RULES gives to nodes, in each of SPACES,
        where each sample is within SNAP of its place."""
        bounds: tuple[list[FloatArray], ...] = [], []
        nodes = [(at + REACH).T for at in RULES.values()]
        curve = self.curve
        if curve is not None:  # all samples are moved alike: single ones would mix channels
            around = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
            for x, y in nodes:
                moved = [curve(radiance[:, y + i, x + j].mean(axis=1)) for i, j in around]
                bounds[0].append(np.min(moved, axis=0))
                bounds[1].append(np.max(moved, axis=0))
        for encode, decode in [(None, None), (srgb, linear)][: 1 if curve is None else 2]:
            values = shown if encode is None else encode(shown)
            for f, of in zip((minimum_filter1d, maximum_filter1d), bounds, strict=True):
                moved = f(f(values, 3, axis=1), 3, axis=2)
                means = (moved[:, y, x].mean(axis=1) for x, y in nodes)
                of += means if decode is None else map(decode, means)
        return bounds

    def widened(self, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What candidates may have whose values are within low and high."""
        low, high = (
            x + sign * self.tolerance * np.maximum(np.abs(x), self.floor)
            for sign, x in ((-1.0, low), (1.0, high))
        )
        if not self.displayed:
            return low, high
        half = 0.5 + 1e-6  # 1e-6: rounding of the two curves
        codes = (255.0 * srgb(np.clip(x, 0.0, 1.0)) for x in (low - 0.0, high + 0.0))
        low, high = (np.clip(x + s * half, 0.0, 255.0) for s, x in zip((-1, 1), codes, strict=True))
        return linear(low / 255.0), linear(high / 255.0)

    def beyond(self, values: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
        """How far values are outside, with their sign."""
        low, high = self.widened(low, high)
        return np.asarray(values - np.clip(values, low, high))


class _Seen(NamedTuple):
    """Of n pixels.  inside, edge: low and high (2, n, 3);  step (n,): whether they are edges.  The
    others are of the channel of most contrast: left (n, rules): what each rule leaves;  modes (n,
    4): the change of the mean by a pixel's shift, ...;  alike (n,): number of equal coverage and
    direction."""

    inside: FloatArray
    edge: FloatArray
    step: BoolArray
    left: FloatArray
    modes: FloatArray
    alike: npt.NDArray[np.int64]


def edges_rung(
    candidate: FloatArray, reference: FloatArray, edges: Edges, displayed: bool
) -> RungResult:
    """The rung `statistics` of a picture without noise.

    reference: exact, also where the candidate is `displayed`, that is of 8-bit sRGB.
    """
    floor = DARK * np.abs(reference.mean(axis=(0, 1))) if edges.floor is None else edges.floor
    law = _Law(edges.tolerance, floor, displayed, edges.curve)
    differs = np.any(law.beyond(candidate, reference, reference), axis=-1)
    chosen = differs | _crossed(edges.look, law, differs.shape)
    row, column = np.nonzero(chosen)
    some = np.unique(np.linspace(0, len(row) - 1, min(len(row), MOST)).astype(int))
    row, column = row[some], column[some]
    values, known = candidate[row, column], reference[row, column]
    seen = _seen(edges.look, law, row, column, values)
    low, high = np.minimum(seen.inside[0], known), np.maximum(seen.inside[1], known)
    outside = np.where(
        seen.step[:, None], law.beyond(values, *seen.edge), law.beyond(values, low, high)
    )
    wrong = np.asarray(outside.any(axis=-1))
    tips = np.flatnonzero(wrong)
    tips = tips[: len(tips) if len(tips) <= MOST_TIPS else 0]
    tips = tips[_are_tips(edges.look, law, row[tips], column[tips], values[tips])]
    wrong[tips], outside[tips] = False, 0.0
    looks = (edges.look, *edges.beside)
    if edges.samples is not None and edges.beside:
        rest = np.flatnonzero(wrong)
        at_rest = row[rest], column[rest]
        rest = rest[are_seen(looks, law.beyond, edges.samples, at_rest, values[rest])]
        wrong[rest], outside[rest] = False, 0.0
    numbers = {
        "pixels": differs.size,
        "chosen": int(chosen.sum()),
        "looked_at": len(row),
        "tolerance": edges.tolerance,
        "codes": displayed,
        "inside": differs.size - int(seen.step.sum()),
        "inside_wrong": int((wrong & ~seen.step).sum()),
        "edge": int(seen.step.sum()),
        "edge_wrong": int((wrong & seen.step).sum()),
        **_of_all(seen, len(tips)),
        "strays": 0,
    }
    at = None
    if wrong.any():
        k, channel = np.unravel_index(np.argmax(np.abs(outside) / (high + law.floor)), low.shape)
        bounds = [x[k, channel] for x in (seen.edge if seen.step[k] else (low, high))]
        at = (
            f"the worst, at x, y = ({column[k]}, {row[k]}): {CHANNELS[channel]} "
            f"{values[k, channel]:.4g}, where {bounds[0]:.4g} to {bounds[1]:.4g} is seen"
        )
    if edges.samples is not None and law.curve is None and differs.any():
        step = np.zeros_like(differs)
        step[row, column] = seen.step
        both = candidate, reference
        found = strays(looks, law.beyond, edges.samples, both, differs, step)
        if found is not None and len(found[0]) > permitted(differs.size):
            numbers["strays"] = len(found[0])
            numbers["stray"] = (int(found[1][0]), int(found[0][0]))
    faults = _faults(numbers, at)
    if edges.others is not None and np.count_nonzero(differs) > permitted(differs.size):
        for name, other in edges.others():
            like = differs & ~np.any(law.beyond(candidate, other, other), axis=-1)
            count, total = int(like.sum()), int(differs.sum())
            if 2 * count > total:
                faults.append(f"{count:,} of {total:,} pixels that differ are those of {name}")
                break
    reason = "; ".join([*faults[:1], _words(numbers), *faults[1:]])
    return RungResult("statistics", "differ" if faults else "agree", reason, numbers)


MOST_STRAYS = 1 << 10
"""Pixels of a picture of the same samples that are looked at: more are no matter of edges."""


def explained_by_edges(
    candidate: FloatArray, reference: FloatArray, edges: Edges
) -> tuple[BoolArray, BoolArray]:
    """Of a picture whose samples are at the reference's places: which pixels (height, width)
    differ, and in which of these an edge explains it, on which a sample falls to either side."""
    floor = DARK * np.abs(reference.mean(axis=(0, 1))) if edges.floor is None else edges.floor
    law = _Law(edges.tolerance, floor, False, None)
    differs = np.any(law.beyond(candidate, reference, reference), axis=-1)
    explained = np.zeros_like(differs)
    row, column = np.nonzero(differs)
    if 0 < len(row) <= MOST_STRAYS:
        values = candidate[row, column]
        seen = _seen(edges.look, law, row, column, values)
        explained[row, column] = seen.step & ~law.beyond(values, *seen.edge).any(axis=-1)
    return differs, explained


def _crossed(look: Look, law: _Law, shape: tuple[int, ...]) -> BoolArray:
    """Which pixels seem to have an edge, by their corners, sides and centre (height, width)."""
    height, width = shape
    x, y = np.meshgrid(0.5 * np.arange(2 * width + 1), 0.5 * np.arange(2 * height + 1))
    radiance = law.shown(look(np.stack([x, y], axis=-1))[0])
    nine = np.stack([
        radiance[i : i + 2 * height - 1 : 2, j : j + 2 * width - 1 : 2]
        for i in range(3)
        for j in range(3)
    ], axis=2).reshape(-1, 3, 3, 3)  # fmt: skip
    return _is_step(law, *_range(nine), COARSE).reshape(shape)


def _is_step(
    law: _Law, low: FloatArray, high: FloatArray, step: FloatArray, share: float
) -> BoolArray:
    """Whether a channel has a step that the law does not permit."""
    seen = (high > law.widened(low, low)[1]) & (step >= share * (high - low))
    return np.asarray(seen.any(axis=-1))


def _seen(
    look: Look,
    law: _Law,
    row: npt.NDArray[np.int64],
    column: npt.NDArray[np.int64],
    values: FloatArray,
) -> _Seen:
    each = 1 << 11  # pixels at once: 20 MB of radiance
    parts = [
        _reduced(*look(_nodes(row[k : k + each], column[k : k + each])), law, values[k : k + each])
        for k in range(0, max(len(row), 1), each)
    ]
    joined = [np.concatenate(x, axis=1 if k < 2 else 0) for k, x in enumerate(zip(*parts))]  # noqa: B905
    return _Seen(*joined)


def _nodes(
    row: npt.NDArray[np.int64],
    column: npt.NDArray[np.int64],
    reach: int = REACH,
    spacing: float = SNAP,
) -> FloatArray:
    """(n, nodes, nodes, 2): the points of n pixels."""
    along = spacing * np.arange(-reach, reach + 1) + 0.5
    corners = np.stack([column, row], axis=-1)[:, None, None]
    return np.asarray(corners + np.stack(np.meshgrid(along, along), axis=-1))


def _are_tips(
    look: Look,
    law: _Law,
    row: npt.NDArray[np.int64],
    column: npt.NDArray[np.int64],
    values: FloatArray,
) -> BoolArray:
    """Whether pixels (n) may show what only those around them see, beyond a step."""
    found = [np.empty(0, np.bool_)]
    for k in range(0, len(row), 64):
        some = slice(k, k + 64)
        radiance, _ = look(_nodes(row[some], column[some], AROUND, SNAP / 2.0))
        low, high, step = _range(law.shown(radiance))
        seen = law.with_mixtures(radiance, low, high)
        outside = law.beyond(values[some], *seen).any(axis=-1)
        found.append(_is_step(law, low, high, step, STEP) & ~outside)
    return np.concatenate(found)


def _range(shown: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The least, the largest, and the largest step of nodes (n, y, x, 3), each (n, 3)."""
    low, high = shown.min(axis=(1, 2)), shown.max(axis=(1, 2))
    step = np.maximum(*(np.abs(np.diff(shown, axis=k)).max(axis=(1, 2)) for k in (1, 2)))
    return low, high, step


def _reduced(radiance: FloatArray, distance: FloatArray, law: _Law, values: FloatArray) -> _Seen:
    """radiance (n, NODES, NODES, 3), distance (n, NODES, NODES), values (n, 3) of the candidate."""
    shown = law.shown(radiance)
    low, high, step = _range(shown)
    channel = np.argmax((high - low) / (high + law.floor + np.finfo(float).tiny), axis=-1)
    one = np.arange(len(radiance)), channel
    contrast = np.where((high > low)[one], (high - low)[one], np.inf)
    rules = law.by_rules(radiance, shown)
    left = [law.beyond(values, *bounds)[one] for bounds in zip(*rules, strict=True)]
    area = len(RULES) - 1
    mean = 0.5 * (rules[0][area] + rules[1][area])[one]
    seen = shown[one[0], :, :, channel]
    inner = seen[:, 1:-1, 1:-1]  # the nodes of the pixel itself
    shift = [inner[:, :, -1] - inner[:, :, 0], inner[:, -1] - inner[:, 0]]
    nearest = distance.min(axis=(1, 2), keepdims=True)
    # Beyond twice the distance all is equally far: what is missed is infinitely far.
    distance = np.minimum(distance, 2.0 * np.minimum(nearest, np.finfo(float).max / 2.0))
    front = distance < 0.5 * (nearest + distance.max(axis=(1, 2), keepdims=True))
    of_front, of_back = (
        (seen * part).sum(axis=(1, 2)) / np.maximum(part.sum(axis=(1, 2)), 1)
        for part in (front, ~front)
    )
    growth = np.where(front.any(axis=(1, 2)), of_front - of_back, 0.0)
    modes = np.stack([*(x.mean(axis=1) for x in shift), growth], axis=-1) / contrast[:, None]
    coverage = np.floor(32.0 * np.clip((mean - low[one]) / contrast, 0.0, 1.0))
    turn = np.floor(16.0 * (np.arctan2(modes[:, 1], modes[:, 0]) / (2.0 * np.pi) + 0.5))
    return _Seen(
        np.stack([np.min(rules[0], axis=0), np.max(rules[1], axis=0)]),
        np.stack(law.with_mixtures(radiance, low, high)),
        _is_step(law, low, high, step, STEP),
        np.stack(left, axis=-1) / contrast[:, None],
        np.column_stack([modes, np.ones(len(modes))]),
        (64 * turn + coverage).astype(np.int64),
    )


def _of_all(seen: _Seen, tips: int) -> dict[str, Any]:
    """The rule that explains all edges best, and the means of what it leaves;  tips: pixels that
    show what is seen around them."""
    left = seen.left[seen.step]
    if not len(left):
        return {"rule": None, "choices": tips, "modes": {}}
    best = int(np.argmin(np.abs(left).sum(axis=0)))
    rest = left[:, best]
    found = {}
    _, alike = np.unique(seen.alike[seen.step], return_inverse=True)
    for name, mode in zip(MODES, seen.modes[seen.step].T, strict=True):
        sums = np.bincount(alike, mode * rest)
        norm = max(float((mode**2).sum()), 1.0)
        error = float(np.sqrt((sums**2).sum())) / norm
        found[name] = {
            "bias": float(sums.sum()) / norm,
            "standard_error": error,
            "detectable": max(MARGIN, STANDARD_ERRORS * error),
            "margin": MARGIN,
        }
    return {
        "rule": [name + space for space in SPACES for name in RULES][best],
        "choices": tips + int(np.count_nonzero(np.abs(rest) > MOST_LEFT)),
        "modes": found,
    }


def _faults(numbers: dict[str, Any], at: str | None) -> list[str]:
    found = []
    for kind, where in (("inside", "inside surfaces differ"), ("edge", "on edges show what none of "
                        "their rays sees")):  # fmt: skip
        if numbers[f"{kind}_wrong"]:
            found.append(f"{numbers[f'{kind}_wrong']:,} of {numbers[kind]:,} pixels {where}")
    if found and at is not None:
        found[-1] += f"; {at}"
    if numbers["strays"]:
        found.append(
            f"{numbers['strays']:,} pixels, such as {numbers['stray']}, differ though the picture "
            "takes the reference's samples: they show what none of these sees within "
            f"{OWN_SNAP:g} of a pixel"
        )
    if numbers["choices"] > max(1, CHOICES * numbers["edge"]):
        found.append(
            f"{numbers['choices']:,} of {numbers['edge']:,} pixels on edges show another surface "
            f"than {numbers['rule']} within {SNAP:g} of a pixel"
        )
    for name, mode in numbers["modes"].items():
        bias, error = mode["bias"], mode["standard_error"]
        if abs(bias) > mode["detectable"]:
            of = "of the contrast" if name == MODES[-1] else "pixels"
            found.append(f"edges have a bias: {name} of {bias:+.2g} ± {error:.1g} {of}")
    return found


def _words(numbers: dict[str, Any]) -> str:
    """What was judged, and how."""
    codes = "half a code and " if numbers["codes"] else ""
    text = (
        f"{numbers['inside']:,} pixels inside surfaces are judged within "
        f"{codes}{100.0 * numbers['tolerance']:.3g} %, {numbers['edge']:,} on edges by what their "
        "footprints see"
    )
    if numbers["rule"]:
        text += f"; edges are explained best by {numbers['rule']}"
    if numbers["looked_at"] < numbers["chosen"]:
        text += f"; {numbers['looked_at']:,} of {numbers['chosen']:,} candidates were looked at"
    return text

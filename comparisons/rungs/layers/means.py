"""Layers that are means over camera rays: tested against Mitsuba's means without an estimate of the
noise.

Both sides are rendered twice, with independent noise.  The difference of the two renderers is
taken once in each half; where they have the same mean, the product of the two differences is 0 in
the mean, whatever the noise is, and otherwise it is the squared bias.  The sum of the products
over all pixels, over the root of the sum of their squares, is compared with LIMIT: of the
products as they are, and of the products over the sum of the two squares, by which a pixel almost
without noise counts as much as one on the edge of a lamp.
"""

import math
from typing import NamedTuple

import numpy as np

from comparisons.mitsuba.counterpart import Counterpart, trace
from comparisons.referee.sizes import ShapeSizes
from comparisons.rungs.layers.seen import FilmPoints, Seen, sensor_rays
from comparisons.rungs.rays.camera import ends
from reference_rt.cameras.film import Filter
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.scene import Scene

LIMIT = 6.0
"""Largest sum of products, in units of the root of the sum of their squares.  The products are
symmetric about 0, as each difference is one of two means of the same samples; then larger values
have a chance of exp(-LIMIT² / 2) = 1.5e-8 at most, whatever the distribution is (Efron 1969)."""

ROUNDING = 1e-5
"""Differences below this fraction of the layer's largest value are 0: Mitsuba's float32 hits and
texels make some 1e-6."""

SCALES = (1, 8)
"""Sides of the squares, in pixels, whose means are tested: single pixels show what changes from
pixel to pixel, larger squares have less noise."""

FIELDS = {"normal": "ns", "position": "p"}
"""The field of a hit that a layer is the mean of."""

AT_ONCE = 1 << 18
"""Rays that Mitsuba traces in one call."""


class Means(NamedTuple):
    """score: to be compared with LIMIT;  bias: the root of the mean squared bias, by the products,
    as a fraction of the layer's largest value;  seen: the bias that would give LIMIT;  worst: the
    upper left pixel (x, y) of the square with the largest product."""

    score: float
    bias: float
    seen: float
    worst: tuple[int, int]


def expected(
    scene: Scene,
    counterpart: Counterpart,
    sizes: ShapeSizes,
    film_filter: Filter,
    names: tuple[str, ...],
    side: int,
    seed: int,
) -> dict[str, FloatArray]:
    """Means (height, width, 3) over side² rays of each pixel of what Mitsuba hits: "albedo",
    "normal" and "position", through `film_filter`."""
    width, height = scene.film.width, scene.film.height
    points, seen = FilmPoints(film_filter), Seen(scene, sizes)
    rng = np.random.default_rng([seed, 2])
    sums = {name: np.zeros((width * height, 3)) for name in names}
    samples = side * side
    step = max(1, AT_ONCE // samples)
    for first in range(0, width * height, step):
        pixels = np.arange(first, min(first + step, width * height))
        each = np.repeat(pixels, samples)
        offset, weight = points.draw(len(pixels), side, rng)
        middle = np.column_stack([each % width, each // width]) + 0.5
        film = (middle + offset.reshape(-1, 2)) / (width, height)
        o, d = sensor_rays(counterpart, film, rng.uniform(size=(len(each), 2)))
        hits = trace(counterpart, o, d, t_max=ends(scene, d))
        for name in names:
            value = seen.colours(hits) if name == "albedo" else getattr(hits, FIELDS[name])
            weighted = value.reshape(len(pixels), samples, 3) * weight[..., None]
            sums[name][pixels] = weighted.mean(axis=1)
    return {name: values.reshape(height, width, 3) for name, values in sums.items()}


def compare_means(
    ours: tuple[FloatArray, FloatArray], theirs: tuple[FloatArray, FloatArray], slack: float = 0.0
) -> Means:
    """Compare two independent halves (height, width, 3) of a layer with two of Mitsuba's;  slack:
    differences below it are 0, besides ROUNDING."""
    size = max(float(np.abs(half).max()) for half in (*ours, *theirs)) or 1.0
    tolerance = max(slack, ROUNDING * size)
    differences = [a - b for a, b in zip(ours, theirs, strict=True)]
    first, second = (
        np.where(np.abs(difference) <= tolerance, 0.0, difference) for difference in differences
    )
    if not (np.isfinite(first).all() and np.isfinite(second).all()):
        y, x = np.argwhere(~np.isfinite(first + second).all(axis=2))[0].tolist()
        return Means(math.inf, math.inf, 0.0, (x, y))
    return max((_at(first, second, scale, size) for scale in SCALES), key=lambda m: m.score)


def _at(first: FloatArray, second: FloatArray, scale: int, size: float) -> Means:
    """The test of means over squares of `scale` x `scale` pixels; what is left at the edges is not
    tested."""
    height, width = (n // scale for n in first.shape[:2])
    if min(height, width) == 0:
        return Means(0.0, 0.0, math.inf, (0, 0))
    halves = (
        x[: height * scale, : width * scale]
        .reshape(height, scale, width, scale, 3)
        .mean(axis=(1, 3))
        for x in (first, second)
    )
    one, two = halves
    products = np.sum(one * two, axis=2)
    squares = np.sum(one * one + two * two, axis=2)
    alike = np.divide(products, squares, out=np.zeros_like(products), where=squares > 0.0)
    total, noise = float(products.sum()), math.sqrt(float(np.sum(products * products)))
    y, x = np.unravel_index(int(np.argmax(products)), products.shape)
    return Means(
        score=max(_score(products), _score(alike)),
        bias=math.sqrt(max(total, 0.0) / products.size) / size,
        seen=math.sqrt(LIMIT * noise / products.size) / size,
        worst=(int(x) * scale, int(y) * scale),
    )


def _score(terms: FloatArray) -> float:
    noise = math.sqrt(float(np.sum(terms * terms)))
    return float(terms.sum()) / noise if noise > 0.0 else 0.0

"""The rung: which layers a scene has, the pictures that are rendered for them, and the result."""

import math
from typing import Any, NamedTuple

import numpy as np

from comparisons.mitsuba.counterpart import Counterpart, trace
from comparisons.referee.sizes import ShapeSizes
from comparisons.results.case import RungResult
from comparisons.rungs.layers.seen import Centres, FilmPoints, Seen, centres, sensor_rays
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.camera import ends
from reference_rt.cameras.film import Film, Filter
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import Path as PathTracing
from reference_rt.integrators import RayCast
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid, Independent, Sobol

__all__ = [
    "LIMIT",
    "VARIANCE_LIMIT",
    "Means",
    "Spread",
    "applies",
    "compare_means",
    "compare_spread",
    "expected",
    "layers",
]


# ---- the layer `variance` against the spread of independent pictures -----------------------------
#
# Of two pictures a, b of a pixel with the estimates va, vb, the mean of (a - b)² / 2 is the true
# variance, and so is the mean of (va + vb) / 2.  Their difference is 0 in the mean, for every
# pixel, pair and channel, whatever the noise is.  It is summed with weights that come from the
# other pictures, so that bright pixels do not count alone and the mean stays 0.


VARIANCE_LIMIT = 6.0
"""Largest sum, in units of its standard error: a chance of 1e-9 each way by the normal
distribution.  The summands are skewed, hence so large."""

SMALLEST = 0.03
"""Smallest relative error of the variance that is reported: of the standard deviation half of it.
It covers what the skewness of few bright pixels leaves of the bound above."""


class Spread(NamedTuple):
    """ratio: the estimated variance over the pictures' spread, weighted means;  score: the
    difference in units of its standard error, positive where the estimate is too large."""

    ratio: float
    score: float

    def differs(self, upper: bool) -> bool:
        """Whether the estimate is wrong;  upper: it may be too large, as for stratified samples."""
        if not math.isfinite(self.score):
            return True
        if abs(self.ratio - 1.0) <= SMALLEST or abs(self.score) <= VARIANCE_LIMIT:
            return False
        return self.score < 0.0 or not upper


def compare_spread(pictures: FloatArray, variances: FloatArray) -> Spread:
    """Compare estimates of the variance of each pixel's mean with the spread of independent
    pictures: both (replicates, height, width, 3), an even number of at least four."""
    count = len(pictures) // 2
    a, b = pictures[0::2], pictures[1::2]
    spread = 0.5 * (a - b) ** 2
    estimate = 0.5 * (variances[0::2] + variances[1::2])
    if not (np.isfinite(spread).all() and np.isfinite(estimate).all()):
        return Spread(math.nan, math.nan)
    if (estimate < 0.0).any():
        return Spread(float(estimate.min()), -math.inf)
    total = estimate + spread
    others = (total.sum(axis=0) - total) / (count - 1)
    typical = others.mean(axis=(1, 2), keepdims=True)
    if not typical.all():
        return Spread(1.0, 0.0)  # a channel without any noise, or nearly
    weight = 1.0 / (others + typical)
    off = weight * (estimate - spread)
    error = math.sqrt(float(np.sum(off * off)))
    ratio = float(np.sum(weight * estimate)) / max(float(np.sum(weight * spread)), 1e-300)
    return Spread(ratio, float(off.sum()) / error if error > 0.0 else 0.0)


# Layers that are means over camera rays: tested against Mitsuba's means without an estimate of the
# noise.
#
# Both sides are rendered twice, with independent noise.  The difference of the two renderers is
# taken once in each half; where they have the same mean, the product of the two differences is 0 in
# the mean, whatever the noise is, and otherwise it is the squared bias.  The sum of the products
# over all pixels, over the root of the sum of their squares, is compared with LIMIT: of the
# products as they are, and of the products over the sum of the two squares, by which a pixel almost
# without noise counts as much as one on the edge of a lamp.


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


MEANS = ("albedo", "normal", "position")
"""Layers that are means over camera rays."""

MOST_PIXELS = 7000
"""Most pixels of the pictures that are rendered for means and variances, if width and height can
be divided by a whole number."""

PICTURES = 4
"""Pictures for the means: two for each of two independent halves."""

SPREAD_PICTURES = 16
"""Pictures for the variance: eight pairs."""

SAMPLES = 32
"""Samples per pixel of each picture for the means.  Only the first hits count: the paths of these
pictures end there, if the integrator can."""

SIDE = 8
"""Mitsuba's film points along each side of a pixel: in a half as many as ours."""

SPREAD_SAMPLES = 8
"""Samples per pixel of each picture for the variance: few, as its estimate is then most in doubt;
from two it would be as noisy as it can be."""


def layers(
    scene: Scene,
    tables: SceneTables,
    counterpart: Counterpart,
    films: tuple[Film, Film],
    seed: int = 0,
) -> RungResult:
    """Compare what is written beside the colour with Mitsuba's hits.

    scene: with a box filter and without layers;  films: ours and Mitsuba's, with filters and
    layers; of ray casting all layers are compared.  Raises SceneError.
    """
    film_layers, film_filters = films[0].layers, (films[0].filter, films[1].filter)
    sizes = ShapeSizes(scene, counterpart.frame)
    if isinstance(scene.integrator, RayCast):
        picture = render(scene, tables=tables)
        cast = centres(scene, tables, counterpart, sizes, picture.layers)
        return _result(_numbers(cast), cast, [])
    small = _smaller(scene)
    numbers: dict[str, Any] = {"layers": list(film_layers)}
    problems: list[str] = []
    found: Centres | None = None
    own_film = small.film.model_copy(update={"filter": film_filters[0], "layers": film_layers})
    if "variance" in film_layers:
        problems += _of_variance(small.changed(film=own_film), tables, numbers)
    seen = {*MEANS, "depth", "id"}.intersection(film_layers)
    if seen:
        pictures = _pictures(_first_hits(small.changed(film=own_film)), tables, PICTURES, SAMPLES)
        first = {name: x[0] for name, x in pictures.items() if name in ("depth", "id")}
        if first:
            found = centres(small, tables, counterpart, sizes, first)
            numbers |= _numbers(found)
        many = {name: x for name, x in pictures.items() if name in MEANS}
        if "position" in many and counterpart.has_planes():
            del many["position"]
            numbers["position"] = "not compared: Mitsuba's infinite planes end"
        if many:
            problems += _of_means(small, counterpart, sizes, film_filters[1], many, seed, numbers)
    return _result(numbers, found, problems)


def applies(scene: Scene, film: Film) -> bool:
    """Whether the rung has anything to compare."""
    return isinstance(scene.integrator, RayCast) or bool(film.layers)


def _of_means(
    scene: Scene,
    counterpart: Counterpart,
    sizes: ShapeSizes,
    film_filter: Filter,
    pictures: dict[str, FloatArray],
    seed: int,
    numbers: dict[str, Any],
) -> list[str]:
    """The problems of means (pictures, height, width, 3), by name; adds to `numbers`."""
    names = tuple(pictures)
    half = PICTURES // 2
    stand_ins = [s for f in counterpart.stand_ins().values() for s in f]
    slack = {
        "normal": max((s.turn for s in stand_ins), default=0.0),
        "position": max((s.sag for s in stand_ins), default=0.0),
    }
    theirs = [
        expected(scene, counterpart, sizes, film_filter, names, SIDE, 2 * seed + k) for k in (0, 1)
    ]
    problems = []
    for name, all_of in pictures.items():
        ours = all_of[:half].mean(axis=0), all_of[half:PICTURES].mean(axis=0)
        found = compare_means(ours, (theirs[0][name], theirs[1][name]), slack.get(name, 0.0))
        numbers |= {
            f"{name}_score": found.score,
            f"{name}_bias": found.bias,
            f"{name}_seen": found.seen,
        }
        if not found.score <= LIMIT:
            problems.append(
                f"{name}: the means of pixels are off by {100.0 * found.bias:.2g} % of the largest "
                f"value, root mean square; two independent halves differ alike ({found.score:.1f} "
                f"standard errors); the worst pixel is {found.worst}"
            )
    return problems


def _of_variance(scene: Scene, tables: SceneTables, numbers: dict[str, Any]) -> list[str]:
    """The problem of the variance, if any; adds to `numbers`."""
    pictures = _pictures(scene, tables, SPREAD_PICTURES, SPREAD_SAMPLES)
    spread = compare_spread(pictures["colour"], pictures["variance"])
    numbers |= {"variance_ratio": spread.ratio, "variance_score": spread.score}
    # Where samples are stratified, the layer is an upper estimate.
    if not spread.differs(upper=not isinstance(_sampler(scene, SPREAD_SAMPLES), Independent)):
        return []
    return [
        f"variance: the layer is {spread.ratio:.3g} times the variance of {SPREAD_PICTURES} "
        f"independent pictures ({spread.score:+.1f} standard errors)"
    ]


def _pictures(scene: Scene, tables: SceneTables, count: int, samples: int) -> dict[str, FloatArray]:
    """The layers (count, height, width[, k]) of pictures with independent seeds."""
    sampler = _sampler(scene, samples)
    pictures = [
        render(
            scene.changed(sampler=sampler.model_copy(update={"seed": sampler.seed + k})),
            tables=tables,
        ).layers
        for k in range(count)
    ]
    return {name: np.stack([p[name] for p in pictures]) for name in pictures[0]}


def _sampler(scene: Scene, samples: int) -> Independent | Sobol:
    """The scene's sampler with so many samples.  Samples on a grid have no seed and are no sample
    of the filter: independent ones are taken."""
    sampler = scene.resolved_sampler
    if isinstance(sampler, Grid):
        return Independent(spp=samples)
    return sampler.model_copy(update={"spp": samples})


def _first_hits(scene: Scene) -> Scene:
    """The scene with paths that end at their first hit, if its integrator can."""
    if isinstance(scene.integrator, PathTracing):
        return scene.changed(integrator=scene.integrator.model_copy(update={"max_depth": 1}))
    return scene


def _smaller(scene: Scene) -> Scene:
    """The scene with width and height divided by the least whole number that leaves MOST_PIXELS; as
    it is if there is none."""
    width, height = scene.film.width, scene.film.height
    for k in range(1, min(width, height) + 1):
        if width % k == height % k == 0 and width * height <= MOST_PIXELS * k * k:
            size = {"width": width // k, "height": height // k}
            return scene.changed(film=scene.film.model_copy(update=size))
    return scene


def _numbers(found: Centres) -> dict[str, Any]:
    return {
        "pixels": found.pixels,
        "unresolved": found.unresolved,
        "wrong_pixels": dict(found.wrong),
        "max_error_over_bound": found.ratio,
    }


def _result(numbers: dict[str, Any], found: Centres | None, problems: list[str]) -> RungResult:
    if found is not None:
        wrong = {name: count for name, count in found.wrong.items() if count}
        if wrong:
            counts = ", ".join(f"{name} of {count}" for name, count in wrong.items())
            text = f"of {found.pixels} pixels differ: {counts}; the first: {found.first}"
            problems = [text, *problems]
    if problems:
        return RungResult("layers", "differ", "; ".join(problems), numbers)
    said: list[str] = []
    if found is not None:
        edges = (
            f"{found.unresolved} of {found.pixels} pixels lie at edges that float32 does not "
            "resolve"
        )
        if arbiter.too_many(found.unresolved, found.pixels):
            return RungResult("layers", "reference-limited", edges, numbers)
        names = ", ".join(found.wrong)
        said.append(f"{names} agree within {found.ratio:.2g} of float32's bound; {edges}")
    said += [
        f"{name} agrees (a bias of {100.0 * numbers[f'{name}_seen']:.2g} % of its largest value, "
        "root mean square, would be seen)"
        for name in ("albedo", "normal")
        if f"{name}_seen" in numbers
    ]
    if "variance_ratio" in numbers:
        said.append(f"variance is {numbers['variance_ratio']:.3f} times the pictures' spread")
    return RungResult("layers", "agree", "; ".join(said), numbers)

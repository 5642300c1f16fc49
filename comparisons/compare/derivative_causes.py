"""Why a derivative is wrong: hypotheses that are rendered, and named only if they leave no
difference.

A wrong derivative is mostly right: it lacks what moves with edges, a light, the bounces; or it is
in another unit.  Our differences of another scene, or with another step, make each of these
pictures, and the statistics say which of them the candidate's is.
"""

import math
from collections.abc import Callable, Iterator
from functools import lru_cache, partial
from itertools import product
from typing import NamedTuple

import numpy as np

from comparisons.compare.path_length import DIRECT
from comparisons.compare.single_lights import each_alone, without_each
from comparisons.results.case import Cause
from comparisons.statistics.cells import Margins
from comparisons.statistics.decide import compare
from comparisons.statistics.sides import side_of
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import Path
from reference_rt.rendering.derivative import (
    REPLICATES,
    Derivative,
    derivative,
    difference,
)
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.scene.parameters import parameter
from reference_rt.util.errors import ReferenceRtError

SEED = 3 << 40
"""Of our replicates: far from those of users."""

PICTURES = SEED + (1 << 32)
"""The first seed of pictures."""

NO_EDGE = 2.0**-30
"""A step, in parts of the parameter's scale, that no sample crosses an edge with: if an edge sweeps
the whole picture by twice the scale, a million samples are crossed in one picture of 500.
Rounding, 2^-53 over the step, is 1e-7."""

UNITS = {
    math.pi / 180.0: "per degree, where the parameter is in radians",
    180.0 / math.pi: "per radian, where the parameter is in degrees",
    2.0: "twice the derivative, as of a radius for a diameter",
    0.5: "half the derivative, as of a diameter for a radius",
    math.pi: "pi times the derivative",
    1.0 / math.pi: "a pi-th of the derivative",
    3.0: "three times the derivative, as the sum over channels",
    1.0 / 3.0: "a third of the derivative, as the mean over channels",
}
"""Factors that have a meaning."""

EDGES = "edges that move are left out"

A_FACTOR = "a constant factor"

NEAR = 0.01
"""How near a factor must be to one of UNITS, and its standard error to nothing."""

NOTHING = 1e-3
"""The size, in parts of the derivative's, of what is called 0: less than any factor that is right
but for a few constants."""

NEAR_NOTHING = 5.0
"""Standard errors from which on a share is none of noise."""

MOST = 16
"""Replicates of a hypothesis, of the scene's samples each: it need not be seen as exactly as the
difference."""

Sizes = Callable[[], tuple[FloatArray, FloatArray]]
"""Replicates of ours and of the candidate with half as many pixels along each side."""


class Ours:
    """Our derivatives of a scene, in replicates (R, height, width, 3)."""

    def __init__(
        self, scene: Scene, path: str, step: float | None = None, threads: int | None = None
    ) -> None:
        self.scene, self.path, self.step, self.threads = scene, path, step, threads
        self.times = 1
        """As many samples as the scene has, times this, in what is compared; hypotheses and pilots
        have the scene's."""
        self._truncations: list[tuple[int, FloatArray]] = []

    @property
    def truncation(self) -> FloatArray:
        """(height, width, 3): the mean of the estimates."""
        counts = [count for count, _ in self._truncations]
        found = np.average([x for _, x in self._truncations], axis=0, weights=counts)
        return np.asarray(found)

    def notes(self) -> tuple[str, ...]:
        """The step of the differences."""
        found = difference(self.scene, self.path, self.step)
        return (f"ours are {found.side} differences with a step of {found.step:.3g}",)

    def replicates(self, count: int, begun: int = 0) -> FloatArray:
        """Those with the seeds from `begun` on, of the scene's samples each."""
        made = []
        for k in range(0, count, REPLICATES):  # so many have one estimate of the truncation
            part = min(REPLICATES, count - k)
            found = self._derivative(self.scene, part, begun + k, self.step, self.times)
            self._truncations.append((part, found.truncation))
            made.append(found.replicates)
        return np.concatenate(made)

    def of(self, scene: Scene, count: int, step: float | None = None, seed: int = 0) -> FloatArray:
        """Those of another scene, or with another step."""
        return self._derivative(scene, count, seed, step or self.step, 1).replicates

    def pictures(self, scene: Scene, count: int) -> FloatArray:
        """Replicates of a scene's picture, not of its derivative."""
        seeds = range(PICTURES, PICTURES + count)
        found = [render(scene, seed=seed, threads=self.threads).colour for seed in seeds]
        return np.stack(found)

    def _derivative(
        self, scene: Scene, count: int, begun: int, step: float | None, times: int
    ) -> Derivative:
        return derivative(
            scene,
            self.path,
            spp=times * scene.resolved_sampler.spp * count,
            seed=SEED + begun,
            replicates=count,
            step=step,
            threads=self.threads,
        )


class _Hypothesis(NamedTuple):
    """name, evidence: of the cause;  make: the candidate's picture if it is so;  rim: pixels along
    the edges of which nothing is known."""

    name: str
    evidence: str
    make: Callable[[], FloatArray]
    rim: int = 0


def likeliest(
    ours: Ours | None,
    right: FloatArray,
    wrong: FloatArray,
    margins: Margins,
    at_half_size: Sizes | None,
) -> Cause | None:
    """The first hypothesis that leaves no difference; None if none does.

    ours: None where there is no scene, and only factors are tried;  right, wrong: replicates of
    both sides;  at_half_size: None where the candidate cannot be rendered again.

    Hypotheses have fewer samples than `right`: where the right derivative with as few is not told
    from the candidate either, none of them is tried, since each would seem to explain it.
    """
    if (found := _factor(right, wrong, margins, at_half_size)) is not None or ours is None:
        return found
    count = min(len(right), MOST)
    few = right[:count] if ours.times == 1 else ours.of(ours.scene, count)
    if is_same(few, wrong, margins):
        return None
    for one in _hypotheses(ours, few):
        try:
            picture = one.make()
        except ReferenceRtError:  # a scene that lacks the parameter, or whose film is too small
            continue
        if picture.shape[1:] != wrong.shape[1:]:
            continue
        inner = [_inner(x, one.rim) for x in (picture, few, wrong)]
        if inner[0].size and is_same(inner[0], inner[2], margins):
            return Cause(one.name, one.evidence, explained(*inner))
        if one.name == EDGES and _size(wrong) <= NOTHING * _size(right):
            return Cause("it is 0", "the candidate does not see the parameter move", 1.0)
    return _detached(ours, few, wrong, margins)


def _detached(ours: Ours, right: FloatArray, wrong: FloatArray, margins: Margins) -> Cause | None:
    """A lamp's size, say, changes the density p of the points that are sampled on it.  Where light
    f / p is differentiated as if p stood still, f p' / p^2 is missing: of a density that is the
    same everywhere, the picture under that lamp alone times the change of ln p."""
    count = len(right)
    for name, scene in each_alone(ours.scene):
        if not hasattr(scene.integrator, "hide_emitters"):
            return None
        # The camera's own view of the lamp is not sampled by it.
        hidden = scene.integrator.model_copy(update={"hide_emitters": True})
        light = ours.pictures(scene.changed(integrator=hidden), count)
        change, error = factor_of(light, right - wrong)
        if not abs(change) > NEAR_NOTHING * error:
            continue
        picture = right - change * light
        if is_same(picture, wrong, margins):
            return Cause(
                "detached sampling",
                f"{change:.4g} ± {error:.1g} times the light of {name} is missing, as where the "
                "density of the points that are sampled there is held while the parameter changes "
                "it",
                explained(picture, right, wrong),
            )
    return None


def is_same(picture: FloatArray, wrong: FloatArray, margins: Margins) -> bool:
    """Whether the statistics see no difference."""
    if not picture.any() and not wrong.any():
        return True
    if not picture.any() or not wrong.any():
        return False
    found = compare(wrong, picture, limit=0.5, margins=margins, signed=True)
    return found.status in ("agree", "inconclusive")


def _size(pictures: FloatArray) -> float:
    """The mean size of their mean, without that of its noise."""
    return float(side_of(pictures, signed=True).size.mean())


def _inner(pictures: FloatArray, rim: int) -> FloatArray:
    height, width = pictures.shape[1:3]
    return pictures[:, rim : height - rim, rim : width - rim]


def explained(picture: FloatArray, right: FloatArray, wrong: FloatArray) -> float:
    """The part of the squared difference that goes."""
    before, after = (_square(wrong, picture=x) for x in (right, picture))
    return min(max(0.0, 1.0 - after / before), 1.0) if before > 0.0 else 0.0


def _square(wrong: FloatArray, picture: FloatArray) -> float:
    """The squared difference without its noise: two halves of the replicates have unrelated
    noise."""
    halves = [wrong[k::2].mean(axis=0) - picture[k::2].mean(axis=0) for k in (0, 1)]
    return float((halves[0] * halves[1]).sum())


def _factor(
    right: FloatArray, wrong: FloatArray, margins: Margins, at_half_size: Sizes | None
) -> Cause | None:
    """A factor of all of it."""
    factor, error = factor_of(right, wrong)
    if not math.isfinite(factor) or error >= 0.1 * abs(factor):
        return None
    told = f"it is {factor:.4g} ± {error:.1g} times the derivative"
    part = explained(factor * right, right, wrong)
    if at_half_size is not None and abs(factor - 1.0) > NEAR + 3.0 * error:
        small, small_error = factor_of(*at_half_size())
        known = small_error < 0.1 * abs(small)  # else anything is four times as large
        scatter = error / abs(factor) + (small_error / abs(small) if known else math.inf)
        if known and abs(0.25 * factor / small - 1.0) < 3.0 * scatter:
            return Cause(
                "a factor that grows with the number of pixels",
                f"{told}, and {small:.4g} ± {small_error:.1g} with a quarter of the pixels",
                part,
            )
    if not is_same(factor * right, wrong, margins):
        return None
    if abs(factor + 1.0) < max(NEAR, 3.0 * error):
        return Cause("the sign", told, part)
    for unit, words in UNITS.items():
        if abs(factor / unit - 1.0) < NEAR and error < NEAR * unit:
            return Cause("another unit of the parameter", f"{told}: {words}", part)
    return Cause(A_FACTOR, told, part)


def factor_of(right: FloatArray, wrong: FloatArray) -> tuple[float, float]:
    """The factor of `right` that is nearest to `wrong` (least squares), and its standard error by
    the replicates.  Halves of `right` make its square, which noise would make larger."""
    count = min(len(right), len(wrong))
    one, two = (right[k::2].mean(axis=0) for k in (0, 1))
    square = float((one * two).sum())
    if square <= 0.0:
        return math.nan, math.inf
    shares = np.array([(w * right.mean(axis=0)).sum() / square for w in wrong[:count]])
    of_right = np.array([(wrong.mean(axis=0) * r).sum() / square for r in right[:count]])
    error = math.hypot(shares.std(ddof=1), 2.0 * of_right.std(ddof=1)) / math.sqrt(count)
    return float(shares.mean()), error


def _hypotheses(ours: Ours, right: FloatArray) -> Iterator[_Hypothesis]:
    """The likeliest first, then the cheapest.  right: of as many replicates as they have."""
    scene, count = ours.scene, len(right)
    scale = parameter(scene, ours.path).scale
    yield _Hypothesis(
        EDGES,
        "so are our differences with a step that no sample crosses an edge with: the difference "
        "sits on silhouettes, and on the edges of shadows and of lamps",
        partial(ours.of, scene, count, NO_EDGE * scale),
    )
    for words, picture in (
        ("the picture is upside down", right[:, ::-1]),
        ("the picture is mirrored", right[:, :, ::-1]),
        ("negative values are cut off", np.maximum(right, 0.0)),
        ("the size in place of the value", np.abs(right)),
    ):
        yield _Hypothesis(words, "so is the derivative, changed so", partial(np.asarray, picture))
    fine = lru_cache(partial(_of_quarter_pixels, ours, count))
    for down, across in product((0, 1, -1), repeat=2):
        if down or across:
            words = " and ".join(way for n, way in ((across, "x"), (down, "y")) if n)
            yield _Hypothesis(
                "half a pixel",
                f"so is the derivative of a picture moved by half a pixel along {words}",
                partial(_moved, fine, down, across),
                rim=1,
            )
    for name, one in without_each(scene):
        yield _Hypothesis(
            f"the share of {name} is missing",
            f"so is the derivative of the scene without {name}",
            partial(ours.of, one, count),
        )
    if isinstance(scene.integrator, Path):
        own = scene.integrator.max_depth
        others = [DIRECT] if own is None else sorted({DIRECT, own - 1, own + 1} - {own})
        for depth in others:
            integrator = scene.integrator.model_copy(update={"max_depth": depth})
            yield _Hypothesis(
                "direct light alone" if depth == DIRECT else "the length of paths",
                f"so is the derivative with max_depth {depth}, where the scene has "
                f"{'no limit' if own is None else own}",
                partial(ours.of, scene.changed(integrator=integrator), count),
            )


def _of_quarter_pixels(ours: Ours, count: int) -> FloatArray:
    """Replicates with twice as many pixels along each side."""
    film = ours.scene.film
    twice = film.model_copy(update={"width": 2 * film.width, "height": 2 * film.height})
    return ours.of(ours.scene.changed(film=twice), count)


def _moved(fine: Callable[[], FloatArray], down: int, across: int) -> FloatArray:
    """The derivative moved by half a pixel, to the right and down where positive; the rim is of no
    use."""
    moved = np.roll(fine(), (down, across), axis=(1, 2))
    count, height, width, _ = moved.shape
    blocks = moved.reshape(count, height // 2, 2, width // 2, 2, 3)
    return np.asarray(blocks.mean(axis=(2, 4)))

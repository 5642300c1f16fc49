"""Tests of means with independent replicates on both sides: the rung for random light transport.

Each side renders the scene R times with independent seeds. The sample of a test is one mean per
replicate (of the image or of a tile), so that what happens inside a picture (correlated pixels,
stratification, the reconstruction filter) needs no model. The comparison is Welch's (1947), with
the variance of either side; the level is shared out over the tests after Šidák (1967).

The degrees of freedom are min(R) - 1, with which the test never exceeds its level (Mickey and Brown
1966), rather than Welch and Satterthwaite's. Those are an approximation for the usual levels; at
the 1e-5 of one tile among many they gave up to 13 (R = 4 and 4) and 95 times (R = 4 and 16) the
false alarms promised (measured, 1.2e7 trials). The price is small from R = 16 on each side.

The rule is one of equivalence: to see no difference is not yet to agree.

- `differ`: a bias larger than the margin is proven, that is, a confidence interval lies wholly
  outside ±IMAGE_MARGIN for a channel of the image, or ±TILE_MARGIN for one of a tile.
- `agree`: nothing differs, and each channel's interval lies wholly inside ±IMAGE_LIMIT.
- `inconclusive`: neither; the reason says how many times more samples would decide.

Not handled: energy in paths so rare that no replicate has met one. Neither the mean nor the
variance of the replicates knows of it, so one side may then falsely be proven different. For the
same reason strongly skewed noise (fireflies) makes the level of a tile with few replicates
approximate. Replicates must have independent seeds: repeats cannot be told from a scene without
noise, whose replicates are rightly equal.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import stats

from comparisons.metrics import count_nonfinite, ratio
from comparisons.results import FloatArray, Status, Tier

IMAGE_MARGIN = 0.001
"""Bias of the image mean that is left to Mitsuba, which computes in float32 and leaves a surface by
(1 + max|p|) * 8.9e-5: in a scene of unit size, about five times that offset."""

TILE_MARGIN = 0.01
"""The same for a tile, of which an edge or a contact shadow fills more than of the image."""

IMAGE_LIMIT = 0.005
"""How far the image mean's interval may reach for `agree`: less than is seen (1 to 2 %), yet wider
than the margin, so that enough samples decide every case."""

FAMILY_LEVEL = 0.0005
"""False alarms of a family of tests. There are two families (channels of the image, channels of
the tiles), so at most one scene in a thousand that is right is said to differ."""

POWER = 0.99
"""Chance of being proven that defines the smallest detectable bias."""

DARK = 0.1
"""Floor of what a bias is relative to, as a fraction of Mitsuba's mean over image and channels.
A tile or a channel darker than this has next to no share in the picture, while light that leaks
in by Mitsuba's ray epsilon is proportional to its surroundings."""

CHANNELS = "RGB"


@dataclass(frozen=True)
class BiasTest:
    """Welch comparisons, one per entry: arrays of one shape, radiance unless said otherwise."""

    difference: FloatArray
    """mean(ours) - mean(mitsuba)"""
    standard_error: FloatArray
    """Of the difference, from both variances."""
    dof: int
    """Degrees of freedom, a lower bound: see the module."""
    scale: FloatArray
    """What a bias is relative to: Mitsuba's mean, at least DARK of its image mean."""
    half_width: FloatArray
    """Of the confidence interval, at the family's level."""
    detectable: FloatArray
    """The smallest true bias that such a run proves to exceed the margin with a chance of POWER,
    if the estimated standard error is the true one."""
    p_value: FloatArray
    """Of the hypothesis |bias| <= margin, two-sided, not corrected for the number of tests."""
    margin: float
    """Permitted bias as a fraction of `scale`."""

    @property
    def relative(self) -> FloatArray:
        """The bias as a fraction of `scale`."""
        return self.over_scale(self.difference)

    @property
    def differs(self) -> npt.NDArray[np.bool_]:
        """Where the confidence interval lies wholly outside ± margin."""
        return np.abs(self.difference) - self.half_width > self.margin * self.scale

    @property
    def worst(self) -> tuple[int, ...]:
        """Index of the smallest p-value; the largest relative bias among equal ones."""
        order = np.lexsort((-np.abs(self.relative).ravel(), self.p_value.ravel()))
        return tuple(int(i) for i in np.unravel_index(order[0], self.p_value.shape))

    def over_scale(self, values: FloatArray) -> FloatArray:
        """`values` as a fraction of `scale`; infinite if Mitsuba's whole picture is black."""
        return ratio(values, self.scale)

    def within(self, limit: float) -> npt.NDArray[np.bool_]:
        """Where the confidence interval lies wholly inside ± limit (a fraction of `scale`)."""
        return np.abs(self.difference) + self.half_width <= limit * self.scale

    def samples_factor(self, limit: float) -> float:
        """How many times the samples bring each interval inside ± limit or beyond the margin.

        With a chance of about POWER, if the present differences are the true ones.
        """
        inside = limit * self.scale - np.abs(self.difference)
        beyond = np.abs(self.difference) - self.margin * self.scale
        reach = self.detectable - self.margin * self.scale
        return float((ratio(reach, np.maximum(inside, beyond)) ** 2).max())


def bias_of_means(
    ours: npt.ArrayLike,
    mitsuba: npt.ArrayLike,
    *,
    margin: float = IMAGE_MARGIN,
    level: float = FAMILY_LEVEL,
) -> BiasTest:
    """Test the image mean of each channel, shape (3,), for a bias beyond `margin`.

    `ours` and `mitsuba` are replicates (R, height, width, 3) of radiance; R may differ and is 2 or
    more, from 16 on the test is sharp. Raises ValueError for other shapes or pixels not finite.
    """
    a, b = _replicates(ours, mitsuba)
    return _welch(a.mean(axis=(1, 2)), b.mean(axis=(1, 2)), float(b.mean()), margin, level)


def bias_of_tiles(
    ours: npt.ArrayLike,
    mitsuba: npt.ArrayLike,
    tile: int = 16,
    *,
    margin: float = TILE_MARGIN,
    level: float = FAMILY_LEVEL,
) -> tuple[BiasTest, tuple[int, int]]:
    """Test each channel of each tile of `tile` x `tile` pixels; otherwise as `bias_of_means`.

    Returns the tests, (rows, columns, 3), and the left and upper edge of the worst tile in pixels.
    The channels stay apart, because an error of hue cancels in luminance. Tiles at the right and
    lower edges are as small as the picture leaves them.
    """
    a, b = _replicates(ours, mitsuba)
    test = _welch(_tile_means(a, tile), _tile_means(b, tile), float(b.mean()), margin, level)
    row, column, _ = test.worst
    return test, (column * tile, row * tile)


def compare_replicates(ours: npt.ArrayLike, mitsuba: npt.ArrayLike, tile: int = 16) -> Tier:
    """Decide whether two sets of replicates have the same mean, by the rule of this module.

    Arguments as for `bias_of_tiles`. Pictures of unlike size and pixels that are not finite are
    `invalid`; two sets that are black throughout are `not-applicable`, for they prove nothing.
    """
    a, b = _float_replicates(ours, "ours"), _float_replicates(mitsuba, "mitsuba")
    if a.shape[1:] != b.shape[1:]:
        reason = f"ours is {a.shape[1:3]} pixels (height, width), Mitsuba's {b.shape[1:3]}"
        return Tier("statistics", "invalid", reason)
    if count_nonfinite(a) or count_nonfinite(b):
        bad = f"{count_nonfinite(a)} of ours, {count_nonfinite(b)} of Mitsuba's"
        return Tier("statistics", "invalid", f"pixels not finite: {bad}")
    if not a.any() and not b.any():
        return Tier("statistics", "not-applicable", "every replicate of either side is black")

    image = bias_of_means(a, b)
    tiles, worst = bias_of_tiles(a, b, tile)
    status, finding = _decide(image, tiles, worst)
    detectable = (
        f"smallest detectable bias {_percent(image.over_scale(image.detectable).max())} of the "
        f"image mean, {_percent(np.median(tiles.over_scale(tiles.detectable)))} of a "
        f"tile (median); intervals at {100.0 * (1.0 - FAMILY_LEVEL)} %"
    )
    numbers = {
        "replicates_ours": len(a),
        "replicates_mitsuba": len(b),
        "confidence": 1.0 - FAMILY_LEVEL,
        "mean_ours": _channels(a.mean(axis=(0, 1, 2))),
        "mean_mitsuba": _channels(b.mean(axis=(0, 1, 2))),
        **_numbers(image, tiles),
        "tile_pixels": tile,
        "worst_tile_x": worst[0],
        "worst_tile_y": worst[1],
    }
    if status == "inconclusive":
        numbers["samples_factor"] = _finite(image.samples_factor(IMAGE_LIMIT))
    return Tier("statistics", status, f"{finding}; {detectable}", numbers)


def _decide(image: BiasTest, tiles: BiasTest, worst_tile: tuple[int, int]) -> tuple[Status, str]:
    if image.differs.any():
        worst = _interval(image, image.worst)
        return "differ", f"image mean {worst}, beyond ±{_percent(image.margin)}"
    if tiles.differs.any():
        count = np.count_nonzero(tiles.differs.any(axis=-1))
        worst = _interval(tiles, tiles.worst)
        return "differ", (
            f"{count} of {tiles.differs[..., 0].size} tiles differ, though not the image mean; "
            f"the worst, at x, y = {worst_tile}: {worst}, beyond ±{_percent(tiles.margin)}"
        )
    reach = image.over_scale(np.abs(image.difference) + image.half_width)
    widest = _interval(image, (int(reach.argmax()),))
    if image.within(IMAGE_LIMIT).all():
        return "agree", f"image mean {widest}, within ±{_percent(IMAGE_LIMIT)}; no tile differs"
    factor = image.samples_factor(IMAGE_LIMIT)
    return "inconclusive", (
        f"too noisy: image mean {widest}, not within ±{_percent(IMAGE_LIMIT)}; about "
        f"{factor:.{0 if factor > 10 else 1}f} times as many samples would decide"
    )


def _float_replicates(images: npt.ArrayLike, name: str) -> FloatArray:
    array = np.asarray(images, dtype=np.float64)
    if array.ndim != 4 or array.shape[0] < 2 or array.shape[3] != 3 or array.size == 0:
        raise ValueError(f"{name}: expected (R >= 2, height, width, 3), got {array.shape}")
    return array


def _replicates(ours: npt.ArrayLike, mitsuba: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    a, b = _float_replicates(ours, "ours"), _float_replicates(mitsuba, "mitsuba")
    if a.shape[1:] != b.shape[1:]:
        raise ValueError(f"the replicates differ in size: ours {a.shape}, mitsuba {b.shape}")
    if count_nonfinite(a) or count_nonfinite(b):
        raise ValueError("the replicates have pixels that are not finite")
    return a, b


def _tile_means(images: FloatArray, tile: int) -> FloatArray:
    """(R, height, width, 3) -> (R, rows, columns, 3), the last row and column maybe narrower."""
    height, width = images.shape[1:3]
    tops, lefts = np.arange(0, height, tile), np.arange(0, width, tile)
    sums = np.add.reduceat(np.add.reduceat(images, tops, axis=1), lefts, axis=2)
    pixels = np.outer(np.diff(tops, append=height), np.diff(lefts, append=width))
    return np.asarray(sums / pixels[None, :, :, None], dtype=np.float64)


def _welch(
    a: FloatArray, b: FloatArray, image_mean: float, margin: float, level: float
) -> BiasTest:
    """Compare samples (R, ...) entry by entry, at `level` for all entries together."""
    mean = b.mean(axis=0)
    difference = a.mean(axis=0) - mean
    scale = np.maximum(np.abs(mean), DARK * abs(image_mean))

    error = np.sqrt(a.var(axis=0, ddof=1) / len(a) + b.var(axis=0, ddof=1) / len(b))
    dof = min(len(a), len(b)) - 1

    level_of_one = -math.expm1(math.log1p(-level) / mean.size)  # Šidák
    critical = stats.t.isf(level_of_one / 2.0, dof)
    # The quantile of the non-central t, after Jennett and Welch (1939): the estimated standard
    # error scatters about the true one by 1 / sqrt(2 dof). Within 3 % even for dof = 1.
    spread = math.sqrt(1.0 + critical**2 / (2.0 * dof))
    reach = critical + stats.norm.isf(1.0 - POWER) * spread
    excess = ratio(np.abs(difference) - margin * scale, error)
    return BiasTest(
        difference=difference,
        standard_error=error,
        dof=dof,
        scale=scale,
        half_width=critical * error,
        detectable=margin * scale + reach * error,
        p_value=np.minimum(1.0, 2.0 * stats.t.sf(excess, dof)),
        margin=margin,
    )


def _numbers(image: BiasTest, tiles: BiasTest) -> dict[str, Any]:
    """By channel for the image; whatever ends in `_bias` is a fraction of the mean."""
    return {
        "relative_bias": _channels(image.relative),
        "standard_error_of_bias": _channels(image.over_scale(image.standard_error)),
        "half_width_of_bias": _channels(image.over_scale(image.half_width)),
        "detectable_bias": _channels(image.over_scale(image.detectable)),
        "p_value": _channels(image.p_value),
        "degrees_of_freedom": image.dof,
        "tiles": tiles.p_value[..., 0].size,
        "tiles_that_differ": int(np.count_nonzero(tiles.differs.any(axis=-1))),
        "tile_detectable_bias": _finite(np.median(tiles.over_scale(tiles.detectable))),
        "worst_tile_channel": CHANNELS[tiles.worst[-1]],
        "worst_tile_bias": _finite(tiles.relative[tiles.worst]),
        "worst_tile_p_value": _finite(tiles.p_value[tiles.worst]),
    }


def _channels(values: FloatArray) -> dict[str, float | None]:
    return {channel: _finite(value) for channel, value in zip(CHANNELS, values, strict=True)}


def _finite(value: float | np.floating[Any]) -> float | None:
    """For JSON: None for what is infinite because Mitsuba's picture is black."""
    return float(value) if math.isfinite(value) else None


def _percent(fraction: float) -> str:
    return f"{100.0 * fraction:.2g} %" if math.isfinite(fraction) else "∞"


def _interval(test: BiasTest, at: tuple[int, ...]) -> str:
    """For example "G +0.12 ± 0.05 %", the half width being the confidence interval's."""
    if not test.scale[at]:
        return f"{CHANNELS[at[-1]]} {test.difference[at]:+.2g} where Mitsuba's picture is black"
    half_width = _percent(test.over_scale(test.half_width)[at])
    return f"{CHANNELS[at[-1]]} {100.0 * test.relative[at]:+.3g} ± {half_width}"

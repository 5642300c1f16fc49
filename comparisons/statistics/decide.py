"""The verdict of the statistics, with its reason and numbers; where the pictures differ beyond
their noise."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from comparisons.results.case import FloatArray, RungResult, Status
from comparisons.statistics.advice import noise_free_candidate, wanted
from comparisons.statistics.metrics import count_nonfinite
from comparisons.statistics.ranks import Uniformity, uniformity
from comparisons.statistics.scales import (
    IMAGE_LEVEL,
    POWER,
    TILE,
    Margins,
)
from comparisons.statistics.sides import Known, known_side, picture_array, side_of
from comparisons.statistics.single import single_factor, single_tests
from comparisons.statistics.unseen import Unseen, unseen, worse
from comparisons.statistics.welch import (
    BiasTest,
    image_test,
    line_test,
    mode_test,
    named_line,
    named_mode,
    pixel_test,
    tile_test,
)
from comparisons.statistics.wording import (
    beyond,
    cell_numbers,
    channels,
    detectable_words,
    finite,
    image_numbers,
    interval,
    line_numbers,
    percent,
    uniformity_numbers,
    uniformity_words,
    unseen_numbers,
    unseen_words,
    which,
)

ONE_PICTURE = (
    "with a single picture on a side the noise is estimated from the spread of the difference over "
    "small blocks, assuming that the noise of neighbouring blocks is independent; an error of a "
    "few pixels, or one that varies within a tile such as a contact shadow, is not told from "
    "noise: only replicates show it"
)

UNKNOWN = (
    "a single picture does not show its noise here, because few bright pixels make it, or because "
    "the difference is unlike noise: give more replicates, with other seeds"
)

NEGATIVE = (
    "the sides differ by less than their replicates' spread says, though no picture of one side "
    "shares noise with one of the other: the replicates of a side make up for each other (negative "
    "correlation), as jointly stratified ones do, so that the errors are smaller than stated"
)

TOP = ("relative_bias", "standard_error_of_bias", "detectable_bias", "p_value")
"""Those of the image's numbers that are repeated at the top level."""


@dataclass(frozen=True)
class Findings:
    """The tests at every scale."""

    image: BiasTest
    tiles: BiasTest
    pixels: BiasTest
    lines: BiasTest | None
    modes: BiasTest | None
    """None for single and for small pictures, as `lines`."""
    uniformity: Uniformity | None
    unseen: Unseen | None
    """The worse of both sides; None if either is a single picture."""
    tile: int
    """Side in pixels."""
    single: bool
    """Whether a side is a single picture."""
    level: float = 1.0
    """The share of the families' levels that was used."""


def compare(
    candidate: npt.ArrayLike,
    reference: npt.ArrayLike | Known,
    *,
    limit: float = 0.005,
    tile: int = TILE,
    margins: Margins | None = None,
    level: float = 1.0,
    fixed_reference: bool = False,
) -> RungResult:
    """Decide whether two sets of replicates have the same mean, by the rule of this package.

    candidate, reference: linear radiance, (R, height, width, 3); R may differ between them, and
    should be 16 or more.  limit: the smallest bias of the image mean that must be detectable, as a
    fraction;  tile: side in pixels.  Pictures of different sizes and pixels that are not finite are
    `invalid`; if both sides are black the rung is `not-applicable`.

    level: the share of each family's level that is used, for one of several looks at a growing
    number of replicates, whose shares must not exceed 1 together; not for single pictures;
    fixed_reference: the reference cannot be rendered with more samples, so that advice is about the
    candidate's.  Raises ValueError for other shapes, for another level than 0 < level <= 1, and for
    a limit that is not larger than the margin of the image mean.
    """
    margins = margins or Margins()
    if not limit > margins.image:
        raise ValueError(f"limit {limit}: expected more than the margin {margins.image}")
    if not 0.0 < level <= 1.0:
        raise ValueError(f"level {level}: expected a share above 0, and 1 at most")
    a = picture_array(candidate, "candidate", 4)
    b, variance = _reference(reference)
    if a.shape[1:] != b.shape[1:]:
        reason = f"candidate is {_size(a)}, reference {_size(b)} pixels (width x height)"
        return RungResult("statistics", "invalid", reason)
    if count_nonfinite(a) or count_nonfinite(b):
        bad = f"{count_nonfinite(a)} of the candidate, {count_nonfinite(b)} of the reference"
        return RungResult("statistics", "invalid", f"pixels not finite: {bad}")
    if variance is not None and not (np.isfinite(variance).all() and variance.min() >= 0.0):
        return RungResult(
            "statistics", "invalid", "the reference's variance is negative or not finite"
        )
    if not a.any() and not b.any():
        return RungResult("statistics", "not-applicable", "every picture of either side is black")
    known = None if variance is None else Known(b[0], variance)
    found = findings(a, known or b, tile, margins, level)
    alone = noise_free_candidate(known or b, margins, level) if fixed_reference else None
    return _verdict(found, a, b, limit, alone)


def findings(
    a: FloatArray, b: FloatArray | Known, tile: int, margins: Margins, level: float = 1.0
) -> Findings:
    """All tests, for pictures (R, h, w, 3) that are finite and of one size;  level: as in
    `compare`."""
    if len(a) == 1 or (not isinstance(b, Known) and len(b) == 1):
        image, tiles, pixels, side = single_tests(a, b, tile, margins)
        return Findings(image, tiles, pixels, None, None, None, None, side, True)
    one = side_of(a)
    two = known_side(b, one.mean) if isinstance(b, Known) else side_of(b)
    return Findings(
        image_test(one, two, margins, level),
        tile_test(one, two, tile, margins, level),
        pixel_test(one, two, margins, level),
        line_test(one, two, margins, level),
        mode_test(one, two, margins, level),
        uniformity(one, two, margins, level),
        worse(*(_unseen(side, level) for side in (a, b))),
        tile,
        False,
        level,
    )


def _unseen(pictures: FloatArray | Known, level: float) -> Unseen | None:
    return None if isinstance(pictures, Known) else unseen(pictures, level * IMAGE_LEVEL)


def read(
    candidate: npt.ArrayLike, reference: npt.ArrayLike | Known, *, finite: bool = True
) -> tuple[FloatArray, FloatArray | Known]:
    """The pictures as float64 arrays. Raises ValueError if they cannot be compared. With `finite`
    false, pixels that are not finite become black; otherwise they raise ValueError."""
    a = picture_array(candidate, "candidate", 4)
    b, variance = _reference(reference)
    if a.shape[1:] != b.shape[1:]:
        raise ValueError(f"candidate is {_size(a)}, reference {_size(b)} pixels (width x height)")
    if not finite:
        a, b = _without_nan(a), _without_nan(b)
    elif count_nonfinite(a) or count_nonfinite(b):
        raise ValueError("pixels are not finite")
    return a, (b if variance is None else Known(b[0], _without_nan(variance)))


def _without_nan(values: FloatArray) -> FloatArray:
    return values if np.isfinite(values).all() else np.nan_to_num(values, posinf=0.0, neginf=0.0)


def _reference(reference: npt.ArrayLike | Known) -> tuple[FloatArray, FloatArray | None]:
    """(S, h, w, 3) and None, or a known mean as (1, h, w, 3) and its variance."""
    if not isinstance(reference, Known):
        return picture_array(reference, "reference", 4), None
    mean = picture_array(reference.mean, "reference's mean", 3)
    variance = picture_array(reference.variance, "reference's variance", 3)
    if mean.shape != variance.shape:
        raise ValueError(f"reference: mean is {mean.shape}, its variance {variance.shape}")
    return mean[None], variance


def _verdict(
    found: Findings, a: FloatArray, b: FloatArray, limit: float, alone: BiasTest | None
) -> RungResult:
    least = _least(found, limit)
    advice, factor = wanted(found.image, limit, alone, found.level, least)
    status, finding = _decide(found, limit, advice)
    unknown = status == "inconclusive" and found.single and not np.isfinite(least)
    image = found.image
    reach = image.over_scale(np.abs(image.difference) + image.half_width).max()
    seen = detectable_words(image, found.tiles, found.tile, found.pixels)
    reason = (
        f"{UNKNOWN if unknown else f'{finding}; {seen}'}; the means are equivalent within "
        f"±{percent(reach)} at {100.0 * (1.0 - found.level * IMAGE_LEVEL):.6g} %"
    )
    if found.unseen is not None and status != "differ":
        reason += f"; {unseen_words(found.unseen)}"
    if found.single:
        reason += f"; {ONE_PICTURE}"
    spread = found.uniformity
    if spread is not None and spread.narrow and not spread.shared:
        reason += f"; {NEGATIVE}: {uniformity_words(spread)}"
    of_image = image_numbers(image)
    numbers = {
        "replicates_candidate": len(a),
        "replicates_reference": len(b),
        "mean_candidate": channels(a.mean(axis=(0, 1, 2))),
        "mean_reference": channels(b.mean(axis=(0, 1, 2))),
        "limit": limit,
        "confidence": 1.0 - found.level * IMAGE_LEVEL,
        "power": POWER,
        **{key: of_image[key] for key in TOP},
        "equivalent_within": finite(reach),
        "samples_factor": finite(factor),
        "advice": advice if status == "inconclusive" else "",
        "noise_known": not unknown,
        "unseen_light": unseen_numbers(found.unseen),
        "image": of_image,
        "tiles": {"side": found.tile, **cell_numbers(found.tiles, found.tile)},
        "pixels": cell_numbers(found.pixels, 1),
        "lines": None if found.lines is None else line_numbers(found.lines),
        "modes": None if found.modes is None else line_numbers(found.modes),
        "uniformity": uniformity_numbers(found.uniformity),
    }
    return RungResult("statistics", status, reason, numbers)


def _decide(found: Findings, limit: float, advice: str) -> tuple[Status, str]:
    """The status and what was found;  advice: how many more samples are needed, in words."""
    image, spread = found.image, found.uniformity
    if image.differs.any():
        text = f"the image mean differs: {beyond(image, image.worst)}"
        if found.tiles.differs.any():
            text += f"; {which(found.tiles, found.tile, 'tiles')}"
        return "differ", text
    if found.tiles.differs.any():
        return "differ", which(found.tiles, found.tile, "tiles", ", though not the image mean")
    if found.pixels.differs.any():
        return "differ", which(found.pixels, 1, "pixels", ", though not a whole tile")
    if found.lines is not None and found.lines.differs.any():
        lines, count = found.lines, np.count_nonzero(found.lines.differs.any(axis=-1))
        line = named_line(lines.worst[0], len(found.pixels.difference))
        return "differ", (
            f"{count} of {len(lines.difference)} rows and columns differ, though no tile and no "
            f"pixel; the worst, {line}: {beyond(lines, lines.worst)}"
        )
    if found.modes is not None and found.modes.differs.any():
        return "differ", (
            "brightness differs smoothly over the picture, though not its mean: "
            f"{named_mode(found.modes.worst[0])}, {beyond(found.modes, found.modes.worst)}"
        )
    if spread is not None and spread.wide:
        return "differ", (
            "small blocks differ more between the sides than within: "
            f"{uniformity_words(spread)} ({spread.mean_beyond_margin:.3f} beyond the margin); many "
            "small differences, or replicates that are not independent of each other"
        )
    if spread is not None and spread.shared:
        return "invalid", (
            f"the sides are not independent of each other: {uniformity_words(spread)}; they share "
            "their noise, as the same seeds or copied pictures do"
        )
    reach = image.over_scale(np.abs(image.difference) + image.half_width)
    widest = f"image mean {interval(image, (int(reach.argmax()),))}"
    sees = bool(np.all(image.over_scale(image.detectable) <= limit))
    inside = bool(image.within(limit).all())
    met = found.unseen is None or found.unseen.missing <= limit
    if inside and sees and met:
        return "agree", f"{widest}, within ±{percent(limit)}; no tile and no pixel differs"
    within = "within" if inside else "not within"
    overlooked = "" if sees else "; a bias of that size could be overlooked"
    if not met:
        overlooked += "; as much light may have been missed by chance, since few samples meet it"
    return "inconclusive", (
        f"too noisy: {widest}, {within} ±{percent(limit)}{overlooked}; {advice}"
    )


def _least(found: Findings, limit: float) -> float:
    """How many times as many samples are needed besides those that make the intervals narrow: to
    meet enough of the rare light; infinite if a single picture does not show it."""
    if found.single:
        return single_factor(found.image, limit)
    return found.unseen.missing / limit if found.unseen is not None else 0.0


def _size(images: FloatArray) -> str:
    return f"{images.shape[2]} x {images.shape[1]}"

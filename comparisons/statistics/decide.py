"""The verdict of the statistics, with its reason and numbers; where the pictures differ beyond
their noise."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from comparisons.results.case import FloatArray, RungResult, Status
from comparisons.statistics.advice import noise_free_candidate, wanted
from comparisons.statistics.cells import POWER, TILE, Margins
from comparisons.statistics.order import by_pairs
from comparisons.statistics.ranks import Uniformity, uniformity
from comparisons.statistics.reading import UnlikePicturesError, read
from comparisons.statistics.scales import IMAGE, PIXELS, SCALES, TILES, Pair, Place, Scale
from comparisons.statistics.sides import Known, Side, known_side, side_of
from comparisons.statistics.single import single_factor, single_tests
from comparisons.statistics.unseen import Unseen, unseen, worse
from comparisons.statistics.welch import BiasTest
from comparisons.statistics.wording import (
    channels,
    detectable_words,
    finite,
    image_numbers,
    interval,
    numbers_of,
    percent,
    uniformity_numbers,
    uniformity_words,
    unseen_numbers,
    unseen_words,
    words_of,
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

    tests: Mapping[str, BiasTest]
    """By the names of the scales (`scales.SCALES`), without those that do not apply."""
    uniformity: Uniformity | None
    """None for single and for small pictures."""
    unseen: Unseen | None
    """The worse of both sides; None if either is a single picture."""
    tile: int
    """Side in pixels."""
    single: bool
    """Whether a side is a single picture."""
    level: float = 1.0
    """The share of the families' levels that was used."""

    @property
    def image(self) -> BiasTest:
        """The test of the image mean."""
        return self.tests[IMAGE.name]

    def place(self, scale: Scale) -> Place:
        """That of the worst of a scale's tests."""
        shape = self.tests[PIXELS.name].difference.shape
        return scale.place(self.tests[scale.name].worst, shape, self.tile)


def compare(
    candidate: npt.ArrayLike,
    reference: npt.ArrayLike | Known,
    *,
    limit: float = 0.005,
    tile: int = TILE,
    margins: Margins | None = None,
    level: float = 1.0,
    fixed_reference: bool = False,
    signed: bool = False,
    paired: bool = False,
) -> RungResult:
    """Decide whether two sets of replicates have the same mean, by the rule of this package.

    candidate, reference: linear radiance, (R, height, width, 3); R may differ between them, and
    should be 16 or more.  limit: the smallest bias of the image mean that must be detectable, as a
    fraction;  tile: side in pixels.  Pictures of different sizes and pixels that are not finite are
    `invalid`; if both sides are black the rung is `not-applicable`.

    level: the share of each family's level that is used, for one of several looks at a growing
    number of replicates, whose shares must not exceed 1 together; not for single pictures;
    fixed_reference: the reference cannot be rendered with more samples, so that advice is about the
    candidate's; signed: pictures of values of both signs, such as derivatives, whose biases are
    fractions of their mean size; two or more of each; paired: replicate i of both sides has the
    same random numbers, so that their differences show the noise. Raises ValueError for other
    shapes, for another level than 0 < level <= 1, and for a limit that is not larger than the
    margin of the image mean.
    """
    margins = margins or Margins()
    if not limit > margins.image:
        raise ValueError(f"limit {limit}: expected more than the margin {margins.image}")
    if not 0.0 < level <= 1.0:
        raise ValueError(f"level {level}: expected a share above 0, and 1 at most")
    try:
        a, b = read(candidate, reference)
    except UnlikePicturesError as error:
        return RungResult("statistics", "invalid", str(error))
    pictures = b.mean[np.newaxis] if isinstance(b, Known) else b
    if not a.any() and not pictures.any():
        return RungResult("statistics", "not-applicable", "every picture of either side is black")
    other = b if isinstance(b, Known) else by_pairs(b)
    if signed and (len(a) < 2 or (not isinstance(b, Known) and len(b) < 2)):
        raise ValueError("a single picture of values of both signs; expected two or more")
    if paired:
        if isinstance(b, Known) or len(a) != len(b) or len(a) < 2:
            raise ValueError("paired replicates: expected as many on both sides, two or more")
        tested = findings(*differences(a, b), tile, margins, level, signed)
        met = worse(*(unseen(np.abs(x), level * IMAGE.level) for x in (a, b)))
        tested = replace(tested, unseen=met)
    else:
        tested = findings(by_pairs(a), other, tile, margins, level, signed)
    alone = noise_free_candidate(b, margins, level, signed) if fixed_reference else None
    return _verdict(tested, a, pictures, limit, alone)


def differences(a: FloatArray, b: FloatArray) -> tuple[FloatArray, Known]:
    """Paired replicates (R, height, width, 3) as a candidate whose deviations from b's mean, which
    is then exact, are the differences of pairs."""
    mean = b.mean(axis=0)
    return a - b + mean, Known(mean, np.zeros_like(mean))


def findings(
    a: FloatArray,
    b: FloatArray | Known,
    tile: int,
    margins: Margins,
    level: float = 1.0,
    signed: bool = False,
) -> Findings:
    """All tests, for pictures (R, h, w, 3) that are finite and of one size;  level, signed: as in
    `compare`."""
    if len(a) == 1 or (not isinstance(b, Known) and len(b) == 1):
        tests, side = single_tests(a, b, tile, margins)
        return Findings(tests, None, None, side, True)
    one = side_of(a, signed)
    two = known_side(b, one.mean, signed) if isinstance(b, Known) else side_of(b, signed)
    pair = Pair(one, two, margins, tile)
    applied = ((scale.name, scale.test(pair, level * scale.level)) for scale in SCALES)
    return Findings(
        {name: test for name, test in applied if test is not None},
        uniformity(one, two, margins, level),
        worse(*(_unseen(side, level) for side in (one, two))),
        tile,
        False,
        level,
    )


def _unseen(side: Side, level: float) -> Unseen | None:
    if side.pictures is None:
        return None
    pictures = np.abs(side.pictures) if side.signed else side.pictures
    return unseen(pictures, level * IMAGE.level)


def _verdict(
    found: Findings, a: FloatArray, b: FloatArray, limit: float, alone: BiasTest | None
) -> RungResult:
    least = _least(found, limit)
    advice, factor = wanted(found.image, limit, alone, found.level, least)
    status, finding = _decide(found, limit, advice)
    unknown = status == "inconclusive" and found.single and not np.isfinite(least)
    image = found.image
    reach = image.over_scale(np.abs(image.difference) + image.half_width).max()
    seen = detectable_words(found.tests, found.tile)
    reason = (
        f"{UNKNOWN if unknown else f'{finding}; {seen}'}; the means are equivalent within "
        f"±{percent(reach)} at {100.0 * (1.0 - found.level * IMAGE.level):.6g} %"
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
        "confidence": 1.0 - found.level * IMAGE.level,
        "power": POWER,
        **{key: of_image[key] for key in TOP},
        "equivalent_within": finite(reach),
        "samples_factor": finite(factor),
        "advice": advice if status == "inconclusive" else "",
        "noise_known": not unknown,
        "unseen_light": unseen_numbers(found.unseen),
        "image": of_image,
        **{scale.name: _numbers(scale, found) for scale in SCALES[1:]},
        "uniformity": uniformity_numbers(found.uniformity),
    }
    return RungResult("statistics", status, reason, numbers)


def _numbers(scale: Scale, found: Findings) -> dict[str, Any] | None:
    if scale.name not in found.tests:
        return None
    side = {"side": found.tile} if scale is TILES else {}
    return side | numbers_of(found.tests[scale.name], found.place(scale))


def _decide(found: Findings, limit: float, advice: str) -> tuple[Status, str]:
    """The status and what was found;  advice: how many more samples are needed, in words."""
    image, spread = found.image, found.uniformity
    differ = [s for s in SCALES if s.name in found.tests and found.tests[s.name].differs.any()]
    for scale in differ[:1]:
        text = words_of(scale, found.tests[scale.name], found.place(scale))
        if scale is IMAGE and TILES in differ:
            text += f"; {words_of(TILES, found.tests[TILES.name], found.place(TILES), alone=False)}"
        return "differ", text
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

"""Candidates without noise that are stored as 8-bit sRGB, as displays show them."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.compare.path_length import Lengths
from comparisons.gate.pictures_in import Picture
from comparisons.gate.question import Question
from comparisons.gate.reference import Reference
from comparisons.results.case import FloatArray
from comparisons.statistics.cells import TILE, cell_pixels, cell_sums
from reference_rt.rendering.image import srgb
from reference_rt.textures.image_file import linear


def as_displayed(
    candidate: Picture, reference: Reference, question: Question
) -> tuple[Reference, Question, str]:
    """The reference as a candidate of 8-bit sRGB should be, the question about it, and a note."""
    if _is_dithered(candidate.radiance, reference.pictures[0]):
        return (
            replace(reference, pictures=candidate.radiance[np.newaxis]),
            replace(question, edges=None),
            "the candidate is stored as 8-bit sRGB: it is within a code of the reference "
            "everywhere, and its errors have no mean, as those of dithering; they count as none",
        )
    lengths = None if question.lengths is None else _displayed_later(question.lengths)
    return (
        replace(reference, pictures=_displayed(reference.pictures)),
        replace(question, lengths=lengths),
        "the candidate is stored as 8-bit sRGB: the reference is rounded and clamped to 1 in the "
        "same way, and brighter values are not compared",
    )


DITHER = 1.0 / 6.0
"""Variance of a code dithered by half a code to either side, and then rounded: twice that of a
number between -1/2 and 1/2."""

UNBIASED = 5.0
"""Standard errors of the mean of such errors that no tile exceeds by chance: one in a million."""


def _is_dithered(candidate: FloatArray, reference: FloatArray) -> bool:
    """Whether the candidate's 8-bit codes are the reference's plus noise of at most a code, without
    a mean in any channel of the picture or of a tile."""
    codes, exact = (255.0 * srgb(np.clip(x, 0.0, 1.0)) for x in (candidate, reference))
    error = codes - exact
    if np.array_equal(np.round(codes), np.round(exact)) or np.abs(error).max() > 1.0 + 1e-6:
        return False
    for side in (TILE, max(error.shape[:2])):
        sums, pixels = cell_sums(error, side), cell_pixels(error, side)
        if np.any(np.abs(sums) > UNBIASED * np.sqrt(DITHER * pixels)):
            return False
    return True


def _displayed(pictures: FloatArray) -> FloatArray:
    """Linear pictures rounded to 8-bit sRGB."""
    return linear(np.round(255.0 * srgb(np.clip(pictures, 0.0, 1.0))) / 255.0)


def _displayed_later(lengths: Lengths) -> Lengths:
    """The same of pictures that are rendered only if they are needed: rounding is no misfit."""

    def hypotheses(reference: FloatArray) -> Iterator[Hypothesis]:
        for one in lengths(reference):
            yield replace(one, picture=_displayed(one.picture))

    return hypotheses

"""Pictures without their rim, whose pixels depend on a renderer's convention.

A filter wider than a pixel reaches beyond the border of the picture. Some renderers take samples
there; others do not, and divide by the weights of the samples that they have. So the outermost
pixels, as many as the filter's radius, differ in their noise and in their mean.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.compare.path_length import Lengths
from comparisons.gate.pictures_in import Picture
from comparisons.gate.question import Question
from comparisons.gate.reference import Reference
from reference_rt.core.arrays import FloatArray
from reference_rt.util.errors import UsageError


def check_rim(shape: tuple[int, ...], pixels: int) -> None:
    """Raise UsageError if pictures (..., height, width, 3) would have nothing left, or if `pixels`
    is negative."""
    height, width = shape[-3:-1]
    if pixels < 0 or min(height, width) <= 2 * pixels:
        raise UsageError(
            f"the rim is {pixels} pixels wide, and the pictures {width} x {height}; "
            "expected 0 or more, and less than half of the shorter side"
        )


def without_rim(
    candidates: Sequence[Picture], reference: Reference, pixels: int
) -> tuple[list[Picture], Reference]:
    """All of them without the outermost `pixels` on each side, and a note in the reference.  Raises
    UsageError: see `check_rim`."""
    check_rim(reference.pictures.shape, pixels)
    cropped = [
        replace(
            picture,
            radiance=without(picture.radiance, pixels),
            opacity=None if picture.opacity is None else without(picture.opacity, pixels),
        )
        for picture in candidates
    ]
    judge = replace(
        reference,
        pictures=without(reference.pictures, pixels, 1),
        variance=None if reference.variance is None else without(reference.variance, pixels),
        notes=(*reference.notes, left_out(pixels)),
    )
    return cropped, judge


def left_out(pixels: int) -> str:
    """The note about it."""
    return (
        f"the outermost {pixels} pixels on each side are left out; positions count from the first "
        "pixel that is compared"
    )


def question_without_rim(question: Question) -> Question:
    """The same for pictures that are rendered only if they are needed."""
    pixels, lights, lengths, edges = question.rim, question.lights, question.lengths, question.edges

    def inner_lights() -> dict[str, FloatArray]:
        assert lights is not None
        return {name: without(light, pixels) for name, light in lights().items()}

    return replace(
        question,
        lights=inner_lights if lights else None,
        lengths=lengths and lengths_without_rim(lengths, pixels),
        edges=None if edges is None else edges.without_rim(pixels),
    )


def lengths_without_rim(lengths: Lengths, pixels: int) -> Lengths:
    """The same for hypotheses about whole pictures."""

    def inner(reference: FloatArray) -> Iterator[Hypothesis]:
        rim = ((pixels, pixels), (pixels, pixels), (0, 0))
        for one in lengths(np.pad(reference, rim)):
            noise = None if one.noise is None else without(one.noise, pixels)
            yield replace(one, picture=without(one.picture, pixels), noise=noise)

    return inner


def without(x: np.ndarray, pixels: int, first: int = 0) -> FloatArray:
    """`x` without its rim along axis `first` and the next."""
    rows, columns = (slice(pixels, x.shape[first + k] - pixels) for k in range(2))
    return x[(slice(None),) * first + (rows, columns)]

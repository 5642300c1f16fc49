"""Pictures without their rim, whose pixels depend on a renderer's convention.

A filter wider than a pixel reaches beyond the border of the picture. Some renderers take samples
there; others do not, and divide by the weights of the samples that they have. So the outermost
pixels, as many as the filter's radius, differ in their noise and in their mean.
"""

from collections.abc import Sequence
from dataclasses import replace

from comparisons.compare.judge import Lights
from comparisons.gate.pictures_in import Picture
from comparisons.gate.reference import Reference, size_of
from reference_rt.core.arrays import FloatArray
from reference_rt.util.errors import UsageError


def without_rim(
    candidates: Sequence[Picture], reference: Reference, lights: Lights | None, pixels: int
) -> tuple[list[Picture], Reference, Lights | None]:
    """All of them without the outermost `pixels` on each side, and a note in the reference.

    Raises UsageError if nothing would be left, or if `pixels` is negative.
    """
    height, width = reference.pictures.shape[1:3]
    if pixels < 0 or min(height, width) <= 2 * pixels:
        raise UsageError(
            f"the rim is {pixels} pixels wide, and the pictures {size_of(reference.pictures[0])}; "
            "expected 0 or more, and less than half of the shorter side"
        )

    def inner(x: FloatArray, first: int = 0) -> FloatArray:
        """`x` without its rim along axis `first` and the next."""
        rows, columns = (slice(pixels, x.shape[first + k] - pixels) for k in range(2))
        return x[(slice(None),) * first + (rows, columns)]

    cropped = [
        replace(
            picture,
            radiance=inner(picture.radiance),
            opacity=None if picture.opacity is None else inner(picture.opacity),
        )
        for picture in candidates
    ]
    note = (
        f"the outermost {pixels} pixels on each side are left out; positions count from the first "
        "pixel that is compared"
    )
    judge = replace(
        reference,
        pictures=inner(reference.pictures, 1),
        variance=None if reference.variance is None else inner(reference.variance),
        notes=(*reference.notes, note),
    )
    if lights is None:
        return cropped, judge, None
    return cropped, judge, lambda: {name: inner(light) for name, light in lights().items()}

"""The pictures of both sides as arrays, or why they cannot be compared."""

import numpy as np
import numpy.typing as npt

from comparisons.results.case import FloatArray
from comparisons.statistics.metrics import count_nonfinite
from comparisons.statistics.sides import Known, picture_array


class UnlikePicturesError(ValueError):
    """Pictures that cannot be compared: of different sizes, or not finite."""


def read(
    candidate: npt.ArrayLike, reference: npt.ArrayLike | Known, *, finite: bool = True
) -> tuple[FloatArray, FloatArray | Known]:
    """The pictures as float64 arrays. Raises ValueError for other shapes, UnlikePicturesError. With
    `finite` false, pixels that are not finite become black; otherwise they raise it, too."""
    a = picture_array(candidate, "candidate", 4)
    b, variance = _reference(reference)
    if a.shape[1:] != b.shape[1:]:
        sizes = f"candidate is {_size(a)}, reference {_size(b)} pixels (width x height)"
        raise UnlikePicturesError(sizes)
    if not finite:
        a, b = _without_nan(a), _without_nan(b)
        return a, (b if variance is None else Known(b[0], _without_nan(variance)))
    if count_nonfinite(a) or count_nonfinite(b):
        bad = f"{count_nonfinite(a)} of the candidate, {count_nonfinite(b)} of the reference"
        raise UnlikePicturesError(f"pixels not finite: {bad}")
    if variance is None:
        return a, b
    if not (np.isfinite(variance).all() and variance.min() >= 0.0):
        raise UnlikePicturesError("the reference's variance is negative or not finite")
    return a, Known(b[0], variance)


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


def _size(images: FloatArray) -> str:
    return f"{images.shape[2]} x {images.shape[1]}"

"""Hypotheses about colours: exchanged channels, saturation, matrices."""

import itertools
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from comparisons.compare.diagnosis.hypothesis import Hypothesis, of_pixels
from comparisons.compare.diagnosis.misfit import Misfit
from comparisons.compare.primaries import SPACES, SRGB, conversion, to_xyz
from comparisons.results.case import FloatArray

CHANNELS = ("red", "green", "blue")

A_MATRIX = "a matrix of colours"

LUMINANCE = to_xyz(SRGB)[1]
"""The share of red, green and blue of sRGB in the luminance."""


def _permutations(misfit: Misfit) -> Iterator[Hypothesis]:
    for order in itertools.permutations(range(3)):
        moved = [k for k in range(3) if order[k] != k]
        if not moved:
            continue
        names = " and ".join(CHANNELS[k] for k in moved) if len(moved) == 2 else "all channels"
        yield of_pixels(
            "channels",
            f"swapped channels: {names}",
            "the candidate's red, green and blue are the reference's "
            + ", ".join(CHANNELS[k] for k in order),
            partial(np.take, indices=list(order), axis=-1),
            misfit.reference,
            0,
        )


def _known_matrices() -> Iterator[tuple[str, FloatArray]]:
    """What is wrong, and the matrix from right colours to wrong ones."""
    for name, space in SPACES.items():
        for adapted in (True, False):
            matrix = conversion(SRGB, space, adapted)
            yield f"{name} where linear sRGB is expected", matrix
            yield f"linear sRGB taken for {name}", np.asarray(np.linalg.inv(matrix))
    yield "CIE XYZ where linear sRGB is expected", to_xyz(SRGB)
    yield "linear sRGB taken for CIE XYZ", np.asarray(np.linalg.inv(to_xyz(SRGB)))
    yield "grey: the luminance in each channel", np.tile(LUMINANCE, (3, 1))
    yield "grey: the mean of the channels in each", np.full((3, 3), 1.0 / 3.0)


def _known(name: str, known: FloatArray, misfit: Misfit) -> Iterator[Hypothesis]:
    evidence = f"the candidate's colours are those of the reference, as {name}"
    yield of_pixels("known matrix", name, evidence, partial(_times, known), misfit.reference, 0)


def _saturation(misfit: Misfit) -> Iterator[Hypothesis]:
    r = misfit.reference
    grey = (r @ LUMINANCE)[..., None] * np.ones(3)
    saturation = 1.0 + misfit.amount(r - grey)
    evidence = f"colours are {saturation:.3g} times as far from grey as the reference's"
    partly_grey = saturation * np.eye(3) + (1.0 - saturation) * LUMINANCE
    yield of_pixels(
        "saturation",
        f"saturation of {saturation:.3g}",
        evidence,
        partial(_times, partly_grey),
        r,
        1,
    )


def _matrix(misfit: Misfit) -> Iterator[Hypothesis]:
    r = misfit.reference
    matrix = misfit.regression(r).T
    rows = "; ".join(" ".join(f"{v:.3g}" for v in row) for row in matrix)
    evidence = f"the candidate's colours are the reference's times the matrix ({rows})"
    yield of_pixels("matrix", A_MATRIX, evidence, partial(_times, matrix), r, 9)


def _times(matrix: FloatArray, picture: FloatArray) -> FloatArray:
    return np.asarray(picture @ matrix.T)


FITS: tuple[Callable[[Misfit], Iterator[Hypothesis]], ...] = (
    _permutations,
    *(partial(_known, name, matrix) for name, matrix in _known_matrices()),
    _saturation,
    _matrix,
)
"""What is fitted to any two pictures."""

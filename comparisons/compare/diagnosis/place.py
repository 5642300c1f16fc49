"""Hypotheses about positions: shifts, mirrors, filters, lenses."""

import math
from collections.abc import Iterator

import numpy as np
from scipy import ndimage, optimize

from comparisons.compare.diagnosis import lens
from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.compare.diagnosis.misfit import Misfit
from comparisons.results.case import FloatArray

FARTHEST = 3
"""The largest shift that is tried, in pixels along x and y."""


CORNERS = np.array([[0.0, 0.0], [0.4, 0.1], [0.1, 0.4]])
"""The initial simplex of the search for a shift, in pixels."""


def hypotheses(misfit: Misfit) -> Iterator[Hypothesis]:
    """All of them, fitted."""
    yield from _mirrors(misfit.reference)
    if min(misfit.reference.shape[:2]) > 2 * FARTHEST:
        yield from _shifts(misfit)
        yield from _filters(misfit)
        yield from lens.hypotheses(misfit)


def _mirrors(r: FloatArray) -> Iterator[Hypothesis]:
    turned = {
        "mirrored left to right": r[:, ::-1],
        "upside down": r[::-1],
        "rotated by 180 degrees": r[::-1, ::-1],
    }
    if r.shape[0] == r.shape[1]:
        across = r.transpose(1, 0, 2)
        turned |= {
            "rows and columns exchanged": across,
            "rotated by 90 degrees to the left": across[::-1],
            "rotated by 90 degrees to the right": across[:, ::-1],
            "rows and columns exchanged, and rotated by 180 degrees": across[::-1, ::-1],
        }
    for name, picture in turned.items():
        yield Hypothesis("mirrored", name, f"the candidate is the reference, {name}", picture, 0)


def _shifted(channels: list[FloatArray], x: float, y: float, order: int) -> FloatArray:
    """Shift single channels, which must be spline coefficients for order 3."""
    moved = [
        ndimage.shift(channel, (y, x), order=order, mode="nearest", prefilter=False)
        for channel in channels
    ]
    return np.stack(moved, axis=-1)


def _whole_shift(misfit: Misfit) -> tuple[int, int]:
    """The best shift by whole pixels."""
    f, r = FARTHEST, misfit.reference
    padded = np.pad(r, ((f, f), (f, f), (0, 0)), mode="edge")
    h, w = r.shape[:2]
    steps = range(-f, f + 1)
    tried = [
        (misfit.squares(padded[f - y : f - y + h, f - x : f - x + w]), (x, y))
        for x in steps
        for y in steps
    ]
    return min(tried)[1]


def _shifts(misfit: Misfit) -> Iterator[Hypothesis]:
    start = _whole_shift(misfit)
    channels = [np.ascontiguousarray(misfit.reference[..., k]) for k in range(3)]
    # Resampled pictures are shifted bilinearly; a cubic spline resembles a shifted camera.
    for order in (1, 3):
        if order == 3:
            channels = [
                np.asarray(ndimage.spline_filter(channel, 3, mode="nearest"))
                for channel in channels
            ]

        def squares(v: FloatArray, of: list[FloatArray] = channels, order: int = order) -> float:
            return misfit.squares(_shifted(of, float(v[0]), float(v[1]), order))

        fit = optimize.minimize(
            squares,
            start,
            method="Nelder-Mead",
            options={
                "initial_simplex": np.array(start) + CORNERS,
                "xatol": 5e-3,
                "fatol": 1e-4 * misfit.excess,
                "maxfev": 50,
            },
        )
        x, y = (float(v) for v in fit.x)
        if max(abs(x), abs(y)) > FARTHEST + 1:
            continue  # the search diverged: only the repeated edge is left of the picture
        evidence = f"the candidate is the reference shifted {x:+.3g}, {y:+.3g} pixels (right, down)"
        yield Hypothesis("shift", _name(x, y), evidence, _shifted(channels, x, y, order), 2)


def _name(x: float, y: float) -> str:
    size = math.hypot(x, y)
    for length, name in ((0.5, "half-pixel shift"), (1.0, "shift by one pixel")):
        along_x, along_y = (abs(abs(v) - length) < 0.1 for v in (x, y))
        if (along_x or abs(x) < 0.1) and (along_y or abs(y) < 0.1) and (along_x or along_y):
            where = " and ".join(axis for axis, is_so in (("x", along_x), ("y", along_y)) if is_so)
            return f"{name} in {where}"
    return f"shift by {size:.2g} pixels"


def _filters(misfit: Misfit) -> Iterator[Hypothesis]:
    r = misfit.reference

    def blurred(sigma: float) -> FloatArray:
        return np.asarray(ndimage.gaussian_filter(r, (sigma, sigma, 0.0), mode="nearest"))

    fit = optimize.minimize_scalar(
        lambda s: misfit.squares(blurred(float(s))),
        bounds=(0.15, 3.0),
        method="bounded",
        options={"xatol": 0.01, "maxiter": 25},
    )
    sigma = float(fit.x)
    evidence = f"the candidate is the reference through a Gaussian of sigma {sigma:.2g} pixels"
    yield Hypothesis("filter", f"blurred by {sigma:.2g} pixels", evidence, blurred(sigma), 1)
    detail = r - blurred(0.7)
    amount = misfit.amount(detail)
    if amount > 0.0:
        evidence = (
            f"details of the size of a pixel are {1.0 + amount:.3g} times as strong as the "
            "reference's"
        )
        yield Hypothesis("filter", "sharpened", evidence, r + amount * detail, 1)

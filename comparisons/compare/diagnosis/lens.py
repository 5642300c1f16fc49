"""Hypotheses about the lens: zoom, barrel and pincushion distortion, chromatic aberration."""

import math
from collections.abc import Iterator

import numpy as np
from scipy import ndimage

from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.compare.diagnosis.misfit import Misfit
from comparisons.results.case import FloatArray

STEPS = ((4.0, 1), (2.0, 1), (1.0, 1), (0.0, 3), (0.0, 3))
"""The width of a blur in pixels and the order of splines: blurred pictures show displacements that
are larger than their details."""

STEP = 0.5
"""Pixels at the corner, by which derivatives are taken."""


def hypotheses(misfit: Misfit) -> Iterator[Hypothesis]:
    """All of them, fitted."""
    yield from _Lens(misfit).hypotheses()


class _Lens:
    """The reference seen with other distances from the middle of the picture."""

    def __init__(self, misfit: Misfit) -> None:
        self._misfit = misfit
        height, width = misfit.reference.shape[:2]
        y, x = np.mgrid[:height, :width].astype(np.float64)
        self._middle = np.array([0.5 * (height - 1), 0.5 * (width - 1)])[:, None, None]
        self._from_middle = np.stack([y, x]) - self._middle
        self._corner = math.hypot(*self._middle.ravel())
        self._square = (self._from_middle**2).sum(axis=0) / self._corner**2

    def hypotheses(self) -> Iterator[Hypothesis]:
        one = np.ones_like(self._square)
        zoom, picture = self._fitted([one])
        size = 1.0 / (1.0 + zoom[0, 0])
        evidence = f"the candidate's view is {size:.4g} times as large, about the picture's middle"
        yield Hypothesis("zoom", f"zoom of {size:.4g}", evidence, picture, 1)
        both, picture = self._fitted([one, self._square])
        barrel = float(both[1, 0])
        name = f"{'barrel' if barrel > 0.0 else 'pincushion'} distortion of {abs(barrel):.2g}"
        evidence = (
            f"points are at 1 {both[0, 0]:+.2g} {barrel:+.2g} r² times their distance from the "
            "middle, r being 1 in the corner"
        )
        yield Hypothesis("distortion", name, evidence, picture, 2)
        each, picture = self._fitted([one], apart=True)
        sizes = ", ".join(f"{1.0 / (1.0 + a):.4g}" for a in each[0])
        evidence = f"red, green and blue are {sizes} times as large, about the picture's middle"
        yield Hypothesis("aberration", "chromatic aberration", evidence, picture, 3)

    def _fitted(
        self, terms: list[FloatArray], apart: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """The amounts (terms, 3) by which points are further from the middle, and the picture;
        apart: of each channel by itself.  Gauss and Newton's method."""
        amounts = np.zeros((len(terms), 3))
        weights = self._misfit.weights
        step = STEP / self._corner
        for blur, order in STEPS:
            reference, candidate = (
                ndimage.gaussian_filter(p, (blur, blur, 0.0), mode="nearest") if blur else p
                for p in (self._misfit.reference, self._misfit.candidate)
            )
            factors = self._factors(terms, amounts)
            inner, seen, outer = (
                self._seen(reference, factors + by, order) for by in (-step, 0.0, step)
            )
            slope, rest = (outer - inner) / (2.0 * step), candidate - seen
            columns = np.stack([slope * term[..., None] for term in terms])
            normal = np.einsum("ahwc,bhwc,hwc->cab", columns, columns, weights)
            wanted = np.einsum("ahwc,hwc,hwc->ca", columns, rest, weights)
            if apart:
                steps = [_solved(n, v) for n, v in zip(normal, wanted, strict=True)]
            else:
                steps = 3 * [_solved(normal.sum(axis=0), wanted.sum(axis=0))]
            amounts = np.clip(amounts + np.stack(steps, axis=1), -MOST, MOST)
        return amounts, self._seen(self._misfit.reference, self._factors(terms, amounts), 3)

    def _factors(self, terms: list[FloatArray], amounts: FloatArray) -> FloatArray:
        """(height, width, 3): of the distance from the middle."""
        return 1.0 + np.tensordot(np.stack(terms, axis=-1), amounts, axes=1)

    def _seen(self, picture: FloatArray, factors: FloatArray, order: int) -> FloatArray:
        channels = [
            ndimage.map_coordinates(
                picture[..., k],
                self._middle + self._from_middle * factors[..., k],
                order=order,
                mode="nearest",
            )
            for k in range(3)
        ]
        return np.stack(channels, axis=-1)


MOST = 0.2
"""Largest change of a distance from the middle that is tried: a fifth."""


def _solved(normal: FloatArray, wanted: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.lstsq(normal, wanted, rcond=None)[0])

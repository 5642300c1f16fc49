"""The tone curve that a picture shows."""

from dataclasses import replace

import numpy as np
from scipy import optimize

from comparisons.gate.tone_curves import CURVES, ToneCurve
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.image import srgb

STOPS = np.arange(-6.0, 6.25, 0.25)
"""Exposures that are tried first, as powers of 2; errors have one minimum between three of them."""

MOST = 1 << 11
"""Pixels that a curve is fitted to."""

EXPLAINED = 0.75
"""Share of lit pixels that are within a code of an estimated curve.  Edges, which may be sampled
otherwise, and what is wrong besides are among the others."""

ALIKE = 0.02
"""Codes of the mean error that distinguish no curves or exposures."""


class _Fit:
    def __init__(self, candidate: FloatArray, reference: FloatArray) -> None:
        lit = np.flatnonzero(reference.any(axis=-1))
        some = lit[np.unique(np.linspace(0, len(lit) - 1, min(len(lit), MOST)).astype(int))]
        self.radiance = reference.reshape(-1, 3)[some]
        self.codes = _codes(candidate.reshape(-1, 3)[some])

    def errors(self, curve: ToneCurve) -> FloatArray:
        return np.asarray(np.abs(_codes(curve(self.radiance)) - self.codes).max(axis=-1))

    def error(self, curve: ToneCurve) -> float:
        return float(self.errors(curve).mean())

    def exposed(self, curve: ToneCurve) -> ToneCurve:
        """The curve at the exposure with the least error: a number of few digits if that does."""

        def at(stop: float) -> float:
            return self.error(replace(curve, exposure=2.0**stop))

        start = min(STOPS, key=at)
        fit = optimize.minimize_scalar(
            at, bounds=(start - 0.25, start + 0.25), method="bounded", options={"xatol": 1e-5}
        )
        best = replace(curve, exposure=float(2.0**fit.x))
        rounded = (float(f"{best.exposure:.{digits}g}") for digits in (1, 2, 3))
        near = (replace(curve, exposure=exposure) for exposure in rounded)
        return next((one for one in near if self.error(one) <= fit.fun + ALIKE), best)


def _codes(values: FloatArray) -> FloatArray:
    return 255.0 * srgb(np.clip(values, 0.0, 1.0))


def estimated(candidate: FloatArray, reference: FloatArray) -> ToneCurve | None:
    """The one of CURVES, with its exposure, that takes a reference (height, width, 3) without noise
    to the candidate, within a code in EXPLAINED of its lit pixels; None if none does."""
    if not (reference.any() and np.isfinite(candidate).all()):
        return None
    fit = _Fit(candidate, reference)
    found = [fit.exposed(ToneCurve(name, of)) for name, of in CURVES.items()]
    least = min(map(fit.error, found))
    best = next(curve for curve in found if fit.error(curve) <= least + ALIKE)
    return best if (fit.errors(best) <= 1.0).mean() >= EXPLAINED else None

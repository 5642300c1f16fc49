"""Hypotheses about tone curves: gammas, sRGB, curves for displays, any curve that rises."""

import math
from collections.abc import Callable, Iterator

import numpy as np
import scipy

from comparisons.compare.diagnosis.colour import LUMINANCE
from comparisons.compare.diagnosis.hypothesis import Hypothesis, of_pixels
from comparisons.compare.diagnosis.misfit import Misfit
from comparisons.results.case import FloatArray
from reference_rt.rendering.image import srgb
from reference_rt.textures.image_file import linear

A_CURVE = "a monotone tone curve"

KNOTS = 8
"""Of a tone curve, with as many of the reference's values between each two, and as many more at
even distances up to the brightest."""

BENT = 1e-3
"""What straight lines between the knots of a curve leave of the squares."""

CUSTOMARY = (1.8, 2.0, 2.2, 2.4)
"""Gammas of displays and files."""

NEAR = 0.03
"""How near a fitted gamma must be to a customary one to be called by it."""


def hypotheses(misfit: Misfit) -> Iterator[Hypothesis]:
    """All of them, fitted."""
    r = np.maximum(misfit.reference, 0.0)
    gamma = _fitted(misfit, lambda g: r**g)
    evidence = f"the candidate is the reference to the power of {gamma:.4g}"
    yield of_pixels(
        "gamma", f"gamma of {gamma:.4g}", evidence, lambda p: _positive(p) ** gamma, r, 1
    )
    for encoded in (_encoded, lambda p: _encoded(_shown(p))):
        yield of_pixels(
            "sRGB",
            "sRGB-encoded values taken for linear ones",
            "the candidate is the reference through the sRGB curve",
            encoded,
            r,
            0,
        )
    yield of_pixels(
        "sRGB",
        "linear values taken for sRGB-encoded ones",
        "the candidate is the reference through the inverse of the sRGB curve",
        lambda p: linear(_shown(p)),
        r,
        0,
    )
    seen = _shown if misfit.candidate.max() <= 1.0 else _positive
    shown = seen(r)
    decoded = _fitted(misfit, lambda g: _encoded(shown) ** g)
    yield of_pixels(
        "encoding",
        f"sRGB decoded by a gamma of {decoded:.2g}" if _is_customary(decoded) else A_CURVE,
        f"the candidate is the reference, encoded as sRGB and decoded by a gamma of {decoded:.4g}",
        lambda p: _encoded(seen(p)) ** decoded,
        r,
        1,
    )
    encoded_by = 1.0 / _fitted(misfit, lambda g: linear(shown**g))
    yield of_pixels(
        "encoding",
        f"a gamma of {encoded_by:.2g} decoded as sRGB" if _is_customary(encoded_by) else A_CURVE,
        f"the candidate is the reference, encoded by a gamma of {encoded_by:.4g} and decoded as "
        "sRGB",
        lambda p: linear(seen(p) ** (1.0 / encoded_by)),
        r,
        1,
    )
    for name, curve in KNOWN.items():
        evidence = f"the candidate is the reference through {name}: it is made for a display"
        yield of_pixels("known curve", name, evidence, curve, r, 0)
    yield from _any_curve(misfit, r)


def _positive(p: FloatArray) -> FloatArray:
    return np.maximum(p, 0.0)


def _shown(p: FloatArray) -> FloatArray:
    return np.clip(p, 0.0, 1.0)


def _encoded(p: FloatArray) -> FloatArray:
    return np.asarray(srgb(_positive(p)))


def _reinhard(p: FloatArray, by: FloatArray) -> FloatArray:
    return _positive(p) / (1.0 + by)


def _filmic(p: FloatArray) -> FloatArray:
    p = _positive(p)
    return np.minimum(p * (2.51 * p + 0.03) / (p * (2.43 * p + 0.59) + 0.14), 1.0)


KNOWN: dict[str, Callable[[FloatArray], FloatArray]] = {
    "Reinhard's tone curve": lambda p: _reinhard(p, _positive(p)),
    "Reinhard's tone curve of the luminance": lambda p: _reinhard(
        p, (_positive(p) @ LUMINANCE)[..., None]
    ),
    "Narkowicz's filmic tone curve": _filmic,
}


def _is_customary(gamma: float) -> bool:
    return any(abs(gamma - known) < NEAR for known in CUSTOMARY)


def _fitted(misfit: Misfit, mapped: Callable[[float], FloatArray]) -> float:
    """The exponent, between 0.3 and 3.3, with the least misfit."""
    fit = scipy.optimize.minimize_scalar(
        lambda g: misfit.squares(mapped(math.exp(g))),
        bounds=(-1.2, 1.2),
        method="bounded",
        options={"xatol": 1e-4},
    )
    return math.exp(float(fit.x))


def _any_curve(misfit: Misfit, r: FloatArray) -> Iterator[Hypothesis]:
    """A power with a gain, and a curve that rises everywhere."""
    gamma = _fitted(misfit, lambda g: _factor(misfit, r**g) * r**g)
    factor = _factor(misfit, r**gamma)
    evidence = f"the candidate is the reference to the power of {gamma:.4g}, times a constant"
    name = f"tone curve: the power of {gamma:.3g}"
    yield of_pixels("power", name, evidence, lambda p: factor * _positive(p) ** gamma, r, 2)
    even = np.linspace(0.0, 1.0, KNOTS + 1)
    knots = np.unique([*np.quantile(r, even), *(r.min() + even * np.ptp(r))])
    if len(knots) < 3:
        return
    slopes = np.clip(r[..., None] - knots[:-1], 0.0, np.diff(knots))
    columns = np.concatenate([np.ones((*r.shape, 1)), slopes], axis=-1)
    curve = columns @ misfit.rising(columns)
    told = ", ".join(
        f"{r.flat[k]:.3g} to {curve.flat[k]:.3g}"
        for k in (int(np.abs(r - q).argmin()) for q in np.quantile(r, [0.1, 0.5, 0.9, 1.0]))
    )
    evidence = f"the candidate is the reference through a curve that rises everywhere: {told}"
    yield Hypothesis("tone curve", A_CURVE, evidence, curve, len(knots), BENT)


def _factor(misfit: Misfit, picture: FloatArray) -> float:
    """The constant by which the picture has the least misfit."""
    return 1.0 + misfit.amount(picture, misfit.candidate - picture)

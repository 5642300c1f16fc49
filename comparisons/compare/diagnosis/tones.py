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


SLIGHT = 0.03
"""A gamma is farther from 1: of radiances far from 1 one that is nearer is a gain, in effect."""

WHITE = 2.0
"""Of a picture that was encoded most values are below it: brighter ones sRGB's curve, encoded and
decoded by another, changes by a gain, in effect."""


def _gamma(misfit: Misfit) -> Iterator[Hypothesis]:
    r = np.maximum(misfit.reference, 0.0)
    gamma = _fitted(misfit, lambda of, g: _positive(of.reference) ** g)
    if abs(gamma - 1.0) < SLIGHT:
        return
    evidence = f"the candidate is the reference to the power of {gamma:.4g}"
    yield of_pixels(
        "gamma", f"gamma of {gamma:.4g}", evidence, lambda p: _positive(p) ** gamma, r, 1
    )


def _encodings(misfit: Misfit) -> Iterator[Hypothesis]:
    r = np.maximum(misfit.reference, 0.0)
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


def _seen(misfit: Misfit) -> Callable[[FloatArray], FloatArray]:
    return _shown if misfit.top <= 1.0 else _positive


def _decoded(misfit: Misfit) -> Iterator[Hypothesis]:
    r, seen = np.maximum(misfit.reference, 0.0), _seen(misfit)
    if np.median(r) > WHITE:
        return
    decoded = _fitted(misfit, lambda of, g: _encoded(seen(of.reference)) ** g)
    yield of_pixels(
        "encoding",
        f"sRGB decoded by a gamma of {decoded:.2g}" if _is_customary(decoded) else A_CURVE,
        f"the candidate is the reference, encoded as sRGB and decoded by a gamma of {decoded:.4g}",
        lambda p: _encoded(seen(p)) ** decoded,
        r,
        1,
    )


def _encoded_by(misfit: Misfit) -> Iterator[Hypothesis]:
    r, seen = np.maximum(misfit.reference, 0.0), _seen(misfit)
    if np.median(r) > WHITE:
        return
    encoded_by = 1.0 / _fitted(misfit, lambda of, g: linear(seen(of.reference) ** g))
    yield of_pixels(
        "encoding",
        f"a gamma of {encoded_by:.2g} decoded as sRGB" if _is_customary(encoded_by) else A_CURVE,
        f"the candidate is the reference, encoded by a gamma of {encoded_by:.4g} and decoded as "
        "sRGB",
        lambda p: linear(seen(p) ** (1.0 / encoded_by)),
        r,
        1,
    )


def _known(misfit: Misfit) -> Iterator[Hypothesis]:
    r = np.maximum(misfit.reference, 0.0)
    for name, curve in KNOWN.items():
        evidence = f"the candidate is the reference through {name}: it is made for a display"
        yield of_pixels("known curve", name, evidence, curve, r, 0)


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


def _fitted(misfit: Misfit, mapped: Callable[[Misfit, float], FloatArray]) -> float:
    """The exponent, between 0.3 and 3.3, with the least misfit: of the whole picture, next to that
    of the sample.  mapped: what a misfit's reference becomes by it."""

    def squares(of: Misfit, g: float) -> float:
        return of.squares(mapped(of, math.exp(g)))

    def searched(of: Misfit) -> float:
        fit = scipy.optimize.minimize_scalar(
            lambda g: squares(of, float(g)),
            bounds=(-1.2, 1.2),
            method="bounded",
            options={"xatol": 1e-4},
        )
        return float(fit.x)

    small = misfit.sampled()
    about = searched(small)
    if small is misfit:
        return math.exp(about)
    # The lowest point of the parabola through three.
    low, middle, high = (squares(misfit, about + k * NEXT) for k in (-1, 0, 1))
    bend = low - 2.0 * middle + high
    if bend > 0.0 and abs(low - high) < 2.0 * bend:
        return math.exp(about + 0.5 * NEXT * (low - high) / bend)
    return math.exp(searched(misfit))


NEXT = 0.01
"""Distance of exponents whose squares make a parabola, relative to them: a sample knows an exponent
to less in any noise in which it is told from 1."""


def _power(misfit: Misfit) -> Iterator[Hypothesis]:
    """With a gain."""
    r = np.maximum(misfit.reference, 0.0)

    def power(of: Misfit, g: float) -> FloatArray:
        curve = _positive(of.reference) ** g
        return _factor(of, curve) * curve

    gamma = _fitted(misfit, power)
    factor = _factor(misfit, r**gamma)
    evidence = f"the candidate is the reference to the power of {gamma:.4g}, times a constant"
    name = f"tone curve: the power of {gamma:.3g}"
    yield of_pixels("power", name, evidence, lambda p: factor * _positive(p) ** gamma, r, 2)


def _any_curve(misfit: Misfit) -> Iterator[Hypothesis]:
    """A curve that rises everywhere."""
    r = np.maximum(misfit.reference, 0.0)
    even = np.linspace(0.0, 1.0, KNOTS + 1)
    knots = np.unique([*np.quantile(r, even), *(r.min() + even * np.ptp(r))])
    if len(knots) < 3:
        return
    curve = np.interp(r, knots, misfit.rising(knots))
    told = ", ".join(
        f"{r.flat[k]:.3g} to {curve.flat[k]:.3g}"
        for k in (int(np.abs(r - q).argmin()) for q in np.quantile(r, [0.1, 0.5, 0.9, 1.0]))
    )
    evidence = f"the candidate is the reference through a curve that rises everywhere: {told}"
    yield Hypothesis("tone curve", A_CURVE, evidence, curve, len(knots), BENT)


def _factor(misfit: Misfit, picture: FloatArray) -> float:
    """The constant by which the picture has the least misfit."""
    return 1.0 + misfit.amount(picture, misfit.candidate - picture)


FITS = (_gamma, _encodings, _decoded, _encoded_by, _known, _power, _any_curve)
"""What is fitted to any two pictures."""

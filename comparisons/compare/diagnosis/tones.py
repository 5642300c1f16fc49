"""Hypotheses about tone curves: gammas, sRGB, curves for displays, any curve that rises."""

import math
from collections.abc import Callable, Iterator

import numpy as np
from scipy import optimize

from comparisons.compare.diagnosis.colour import LUMINANCE
from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.compare.diagnosis.misfit import Misfit
from comparisons.results.case import FloatArray
from reference_rt.rendering.image import srgb
from reference_rt.textures.image_file import linear

A_CURVE = "a monotone tone curve"

KNOTS = 8
"""Of a tone curve, with as many of the reference's values between each two, and as many more at
even distances up to the brightest."""

CUSTOMARY = (1.8, 2.0, 2.2, 2.4)
"""Gammas of displays and files."""

NEAR = 0.03
"""How near a fitted gamma must be to a customary one to be called by it."""


def hypotheses(misfit: Misfit) -> Iterator[Hypothesis]:
    """All of them, fitted."""
    r = np.maximum(misfit.reference, 0.0)
    gamma = _fitted(misfit, lambda g: r**g)
    evidence = f"the candidate is the reference to the power of {gamma:.4g}"
    yield Hypothesis("gamma", f"gamma of {gamma:.4g}", evidence, r**gamma, 1)
    clipped = np.clip(r, 0.0, 1.0)
    for encoded in (srgb(r), srgb(clipped)):
        yield Hypothesis(
            "sRGB",
            "sRGB-encoded values taken for linear ones",
            "the candidate is the reference through the sRGB curve",
            encoded,
            0,
        )
    yield Hypothesis(
        "sRGB",
        "linear values taken for sRGB-encoded ones",
        "the candidate is the reference through the inverse of the sRGB curve",
        linear(clipped),
        0,
    )
    shown = clipped if misfit.candidate.max() <= 1.0 else r
    decoded = _fitted(misfit, lambda g: srgb(shown) ** g)
    yield Hypothesis(
        "encoding",
        f"sRGB decoded by a gamma of {decoded:.2g}" if _is_customary(decoded) else A_CURVE,
        f"the candidate is the reference, encoded as sRGB and decoded by a gamma of {decoded:.4g}",
        srgb(shown) ** decoded,
        1,
    )
    encoded_by = 1.0 / _fitted(misfit, lambda g: linear(shown**g))
    yield Hypothesis(
        "encoding",
        f"a gamma of {encoded_by:.2g} decoded as sRGB" if _is_customary(encoded_by) else A_CURVE,
        f"the candidate is the reference, encoded by a gamma of {encoded_by:.4g} and decoded as "
        "sRGB",
        linear(shown ** (1.0 / encoded_by)),
        1,
    )
    luminance = (r @ LUMINANCE)[..., None]
    filmic = r * (2.51 * r + 0.03) / (r * (2.43 * r + 0.59) + 0.14)
    for name, mapped in (
        ("Reinhard's tone curve", r / (1.0 + r)),
        ("Reinhard's tone curve of the luminance", r / (1.0 + luminance)),
        ("Narkowicz's filmic tone curve", np.minimum(filmic, 1.0)),
    ):
        evidence = f"the candidate is the reference through {name}: it is made for a display"
        yield Hypothesis("known curve", name, evidence, mapped, 0)
    yield from _any_curve(misfit, r)


def _is_customary(gamma: float) -> bool:
    return any(abs(gamma - known) < NEAR for known in CUSTOMARY)


def _fitted(misfit: Misfit, mapped: Callable[[float], FloatArray]) -> float:
    """The exponent, between 0.3 and 3.3, with the least misfit."""
    fit = optimize.minimize_scalar(
        lambda g: misfit.squares(mapped(math.exp(g))),
        bounds=(-1.2, 1.2),
        method="bounded",
        options={"xatol": 1e-4},
    )
    return math.exp(float(fit.x))


def _any_curve(misfit: Misfit, r: FloatArray) -> Iterator[Hypothesis]:
    """A power with a gain, and a curve that rises everywhere."""
    gamma = _fitted(misfit, lambda g: _scaled(misfit, r**g))
    power = _scaled(misfit, r**gamma)
    evidence = f"the candidate is the reference to the power of {gamma:.4g}, times a constant"
    yield Hypothesis("power", f"tone curve: the power of {gamma:.3g}", evidence, power, 2)
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
    yield Hypothesis("tone curve", A_CURVE, evidence, curve, len(knots))


def _scaled(misfit: Misfit, picture: FloatArray) -> FloatArray:
    """The picture times the constant with the least misfit."""
    return np.asarray((1.0 + misfit.amount(picture, misfit.candidate - picture)) * picture)

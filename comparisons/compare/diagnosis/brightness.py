"""Hypotheses about brightness: gain, offset, limits, lights."""

import math
from collections.abc import Iterator, Mapping
from functools import partial

import numpy as np

from comparisons.compare.diagnosis.colour import CHANNELS
from comparisons.compare.diagnosis.hypothesis import Hypothesis, of_pixels
from comparisons.compare.diagnosis.misfit import REST, Misfit
from comparisons.results.case import FloatArray
from reference_rt.rendering.image import srgb
from reference_rt.textures.image_file import linear

REMARKABLE = {
    2.0: "twice",
    0.5: "half",
    math.pi: "pi times",
    1.0 / math.pi: "1/pi of",
    4.0 * math.pi: "4 pi times",
    0.25 / math.pi: "1/(4 pi) of",
    4.0: "four times",
    0.25: "a quarter of",
}
"""Factors with a likely origin, and their names."""

NEAR = 0.01
"""Relative difference up to which a fitted factor counts as a remarkable one."""


LITTLE = 0.01
"""Where no more than this of the light is left, a gain near 0 explains that about as well as a lost
light does, and says less: it is no rival."""


def _gain(misfit: Misfit) -> Iterator[Hypothesis]:
    r = misfit.reference
    gain = 1.0 + misfit.amount(r)
    evidence = f"the candidate is {gain:.4g} times the reference ({100.0 * (gain - 1.0):+.3g} %)"
    for factor, name in REMARKABLE.items():
        if abs(gain / factor - 1.0) < NEAR:
            evidence += f", {name} what it should be"
    yield of_pixels("gain", f"constant gain of {gain:.4g}", evidence, lambda p: gain * p, r, 1)


def _gains(misfit: Misfit) -> Iterator[Hypothesis]:
    r = misfit.reference
    gains = np.ones(3)
    for k, channel in enumerate(CHANNELS):
        alone = np.zeros_like(r)
        alone[..., k] = r[..., k]
        amount = misfit.amount(alone)
        gains[k] += amount
        evidence = f"{channel} is {1.0 + amount:.4g} times the reference's; other channels agree"
        only = np.where(np.arange(3) == k, 1.0 + amount, 1.0)
        yield of_pixels(
            "gain of a channel",
            f"gain of {channel} of {1 + amount:.4g}",
            evidence,
            partial(np.multiply, only),
            r,
            1,
        )
    each = ", ".join(f"{g:.4g}" for g in gains)
    evidence = f"red, green and blue are {each} times the reference's"
    yield of_pixels("gains", "another gain of each channel", evidence, lambda p: gains * p, r, 3)
    amount = misfit.amount(np.ones_like(r))
    evidence = f"every pixel of the candidate differs from the reference by {amount:+.3g} W/sr/m²"
    yield of_pixels(
        "offset", f"constant offset of {amount:+.3g}", evidence, partial(np.add, amount), r, 1
    )


def _vignette(misfit: Misfit) -> Iterator[Hypothesis]:
    """A gain, and one that changes with the square, and its square, of the distance from the
    middle."""
    r = misfit.reference
    y, x = (np.linspace(-1.0, 1.0, n) * n for n in r.shape[:2])
    square = y[:, None] ** 2 + x**2
    square = (square / max(float(square.max()), 1e-300))[..., None]
    columns = np.stack([r, r * square, r * square**2], axis=-1)
    factors = misfit.nearest(columns)
    corner, middle = float(factors.sum()), float(factors[0])
    evidence = (
        f"the candidate is {middle:.4g} times the reference in the middle of the picture, and "
        f"{corner:.4g} times in its corners"
    )
    name = f"vignette: corners have {corner / middle:.3g} of the middle's light"
    if corner > 0.0 and middle > 0.0:
        yield Hypothesis("vignette", name, evidence, columns @ factors, 3)


def _limits(misfit: Misfit) -> Iterator[Hypothesis]:
    r, top = misfit.reference, misfit.top
    above = r > top
    if above.any() and top > 0.0:
        count = int(np.count_nonzero(above))
        evidence = f"{count} values of the reference are above the candidate's maximum, {top:.6g}"
        name = f"highlights clamped to {top:.4g}"
        yield of_pixels("clamped", name, evidence, partial(np.minimum, top), r, 1)
    clipped = np.clip(r, 0.0, 1.0)
    for name, rounded in (
        ("sRGB", linear(np.round(255.0 * srgb(clipped)) / 255.0)),
        ("linear", np.round(255.0 * clipped) / 255.0),
    ):
        if len(np.unique(misfit.candidate[..., 0].astype(np.float32))) > 256:
            continue
        evidence = f"the candidate is the reference rounded to 8 bits ({name})"
        yield Hypothesis("8 bits", f"rounded to 8 bits ({name})", evidence, rounded, 0)


ONE = 0.1
"""How close to -1 or +1 the excess of a light must be for it to be called lost or doubled."""


FITS = (_gain, _gains, _vignette, _limits)
"""What is fitted to any two pictures."""


def is_of_light(gain: Hypothesis, misfit: Misfit) -> bool:
    """Whether a gain leaves so little light that a lost light says more."""
    return gain.family == "gain" and gain.picture.mean() <= LITTLE * misfit.reference.mean()


def of_lights(misfit: Misfit, lights: Mapping[str, FloatArray]) -> Iterator[Hypothesis]:
    """Single lights, lost or of another strength."""
    r = misfit.reference
    for name, light in lights.items():
        if light.shape != r.shape or not np.isfinite(light).all() or not light.any():
            continue
        amount = misfit.amount(light)
        if abs(amount + 1.0) < ONE:
            what = f"lost light: {name}"
        elif abs(amount - 1.0) < ONE:
            what = f"light counted twice: {name}"
        else:
            what = f"light of another strength: {name}"
        evidence = f"the candidate has {1.0 + amount:.3g} times what the reference has of {name}"
        # Its picture has noise of its own.
        yield Hypothesis("light", what, evidence, r + amount * light, 1, REST)

"""Histograms of a case's differences, as inline SVG in the text colour of the page around them.

Of the difference in radiance, with a logarithmic axis of counts; and of z, the difference in
standard errors, beside the density that noise alone has: for right pictures they agree.
"""

import math
from dataclasses import dataclass
from html import escape

import numpy as np

from comparisons.report.values import percent, shown
from comparisons.results.case import FloatArray, Images

WIDTH, HEIGHT, FOOT = 320, 120, 18
"""Units of the drawing; FOOT of its height is for the numbers below the axis."""

BINS = 48

Z_SPAN = 6.0
"""Standard errors at the ends of the axis: noise alone has one value of 5e8 beyond."""


@dataclass(frozen=True)
class Histogram:
    """title, and what the curve is;  svg: an <svg> element, trusted;  text: a sentence that says
    the same."""

    title: str
    svg: str
    text: str


def histograms(images: Images, span: float) -> list[Histogram]:
    """Those that can be drawn: none of pictures that differ in size, z only where the standard
    errors are known.  span: the radiance at the ends of the axis of the difference."""
    if images.candidate.shape != images.reference.shape or not images.candidate.size:
        return []
    with np.errstate(all="ignore"):
        difference = images.candidate - images.reference
        found = [_of_difference(difference[np.isfinite(difference)], span)]
        if images.error is not None:
            known = np.isfinite(difference) & (images.error > 0.0) & np.isfinite(images.error)
            found.append(_of_z(difference[known] / images.error[known]))
    return [one for one in found if one is not None]


def _of_difference(values: FloatArray, span: float) -> Histogram | None:
    if not values.size or not span > 0.0:
        return None
    counts = _counts(values, span)
    darker, brighter = float((values < 0.0).mean()), float((values > 0.0).mean())
    text = f"{percent(brighter)} of the values are brighter, {percent(darker)} darker"
    heights = np.log1p(counts) / math.log1p(counts.max())
    title = "Difference in radiance (counts: logarithmic)"
    return Histogram(title, _svg(title, text, heights, span), text)


def _of_z(values: FloatArray) -> Histogram | None:
    values = values[np.isfinite(values)]
    if not values.size:
        return None
    counts = _counts(values, Z_SPAN)
    edges = np.linspace(-Z_SPAN, Z_SPAN, BINS + 1)
    normal = np.diff([0.5 * (1.0 + math.erf(x / math.sqrt(2.0))) for x in edges]) * values.size
    most = max(counts.max(), normal.max())
    beyond = float((np.abs(values) > 3.0).mean())
    text = f"{percent(beyond)} of the values are beyond 3 standard errors; noise alone has 0.27 %"
    title = "Difference in standard errors (line: noise alone)"
    return Histogram(title, _svg(title, text, counts / most, Z_SPAN, normal / most), text)


def _counts(values: FloatArray, span: float) -> FloatArray:
    """How many values each bin has; those beyond the ends are in the outermost bins."""
    shares = np.clip(values / span, -1.0, 1.0)  # bins of the values themselves could underflow
    return np.histogram(shares, BINS, (-1.0, 1.0))[0].astype(np.float64)


def _svg(
    title: str, text: str, heights: FloatArray, span: float, curve: FloatArray | None = None
) -> str:
    """Bars of heights from 0 to 1 above an axis from -span to span."""
    base, step = HEIGHT - FOOT, WIDTH / BINS
    bars = "".join(
        f"M{k * step:.1f} {base}v{-height * (base - 4):.1f}h{step:.1f}V{base}"
        for k, height in enumerate(heights)
        if height > 0.0
    )
    line = ""
    if curve is not None:
        points = " ".join(
            f"{(k + 0.5) * step:.1f},{base - height * (base - 4):.1f}"
            for k, height in enumerate(curve)
        )
        line = f'<polyline class="noise" points="{points}"/>'
    ends = shown(span)
    labels = (
        f'<text x="0" y="{HEIGHT - 4}">−{ends}</text>'
        f'<text x="{WIDTH / 2}" y="{HEIGHT - 4}" text-anchor="middle">0</text>'
        f'<text x="{WIDTH}" y="{HEIGHT - 4}" text-anchor="end">+{ends}</text>'
    )
    return (
        f'<svg class="histogram" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        f'aria-label="{escape(f"{title}: {text}")}">'
        f'<path class="bars" d="{bars}"/><path class="axis" d="M0 {base}H{WIDTH}"/>'
        f"{line}{labels}</svg>"
    )

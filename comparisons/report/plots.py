"""Log-log plots as inline SVG, in the text colour of the page around them."""

import hashlib
import io
import math
import re
import shlex
import sys
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from comparisons.report.templates import write
from comparisons.report.values import percent, power_of_ten, shown
from comparisons.results.case import FloatArray, Images

# Histograms of a case's differences, as inline SVG in the text colour of the page around them.
#
# Of the difference in radiance, with a logarithmic axis of counts; and of z, the difference in
# standard errors, beside the density that noise alone has: for right pictures they agree.


WIDTH, HEIGHT, FOOT = 320, 120, 18
"""Units of the drawing; FOOT of its height is for the numbers below the axis."""

BINS = 48

ROUNDING = 2.0**-20
"""What float32 arithmetic may make of a value, relatively (sixteen roundings): a standard error
below it is no noise."""

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
            noisy = images.error > ROUNDING * np.abs(images.reference)
            known = np.isfinite(difference) & noisy & np.isfinite(images.error)
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


PALETTE = ("#0072b2", "#d55e00", "#779966", "#cc0099", "#0099ee", "#995566", "#bb7799", "#bb3300")
"""Colours of curves in turn: a contrast of at least 3 on white and on the dark page, and distinct
for every kind of colour vision (CIEDE2000 of any two at least 10)."""

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
"""Markers of curves in turn, so that curves do not differ in colour alone.  Earlier curves have
larger, open markers and thicker lines, so that curves in the same place are all visible."""

_INK = "#010203"
"""Placeholder for the page's text colour while matplotlib draws."""

_STYLE: dict[str, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "reference_rt",
    "font.family": "sans-serif",
    "font.size": 10.0,
    "axes.edgecolor": _INK,
    "axes.labelcolor": _INK,
    "axes.titlesize": 11.0,
    "text.color": _INK,
    "xtick.color": _INK,
    "ytick.color": _INK,
    "grid.color": _INK,
    "grid.alpha": 0.13,
    "axes.spines.top": False,
    "axes.spines.right": False,
}

_NO_METADATA = dict.fromkeys(("Date", "Creator", "Format", "Type"))


@dataclass(frozen=True)
class Curve:
    """Points joined by a line, with a band.

    x, y (n,);  low, high (n,): the band, if any;  dashed: for fits, not measurements;  colour:
    index into `PALETTE`, by default the curve's number in the plot;  marked: whether the points
    have markers.  Points where x or y is not positive and finite are skipped; a band whose lower
    end is not positive extends to the plot's edge.
    """

    name: str
    x: npt.ArrayLike
    y: npt.ArrayLike
    low: npt.ArrayLike | None = None
    high: npt.ArrayLike | None = None
    dashed: bool = False
    colour: int | None = None
    marked: bool = True


def log_log(
    curves: Sequence[Curve],
    x_label: str,
    y_label: str,
    title: str = "",
    levels: Mapping[str, float] | None = None,
    size: tuple[float, float] = (6.4, 4.6),
    uprights: Mapping[str, float] | None = None,
) -> str:
    """An <svg> element with both axes logarithmic; the same arguments give the same text.

    levels, uprights: named horizontal and vertical lines;  size: width and height in inches of
    72 px; the element shrinks with its parent.  Text stays text, in the page's colour; ids are
    unique among plots that differ.  A curve with an empty name is not in the legend.
    """
    import matplotlib.style
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    with matplotlib.style.context(["default", _STYLE]):
        figure = Figure(figsize=size)
        FigureCanvasSVG(figure)
        axes = figure.add_subplot()
        axes.set_xscale("log")
        axes.set_yscale("log")
        numbers = [k if c.colour is None else c.colour for k, c in enumerate(curves)]
        last = max(numbers, default=0)
        drawn = [_draw(axes, c, k, last - k) for c, k in zip(curves, numbers, strict=True)]
        _limit(axes, [points for points in drawn if len(points[0])], levels or {})
        bottom, top = axes.get_ylim()
        for name, y in (levels or {}).items():
            if bottom <= y <= top:
                axes.axhline(y, color=_INK, linewidth=0.8, linestyle=":", alpha=0.7)
                place = ((0.0, y), (3, 7), axes.get_yaxis_transform(), "offset points")
                axes.annotate(name, *place, fontsize=8.5)
        left, right = axes.get_xlim()
        for name, x in (uprights or {}).items():
            if left <= x <= right:
                axes.axvline(x, color=_INK, linewidth=0.8, linestyle=":", alpha=0.7)
                place = ((x, 1.0), (-3, -3), axes.get_xaxis_transform(), "offset points")
                axes.annotate(name, *place, fontsize=8.5, rotation=90, ha="right", va="top")
        for axis, most in ((axes.xaxis, round(1.4 * size[0])), (axes.yaxis, 12)):
            _ticks(axis, most)
        axes.grid(visible=True, which="major")
        axes.set_xlabel(x_label)
        axes.set_ylabel(y_label)
        if title:
            axes.set_title(title, loc="left", y=1.01)  # given: finding it measures all labels
        named = sum(bool(curve.name) for curve in curves)
        if named:
            figure.legend(loc="lower left", ncols=min(named, 2), frameon=False, fontsize=9.0)
        _margins(figure, -(-named // 2), bool(title))
        stream = io.StringIO()
        figure.savefig(stream, format="svg", transparent=True, metadata=_NO_METADATA)
    return _inline(stream.getvalue(), title or f"{y_label} against {x_label}")


def _margins(figure: Any, rows: int, titled: bool) -> None:
    """Fixed margins, in inches, for labels of five characters, a title and a legend of some rows:
    Matplotlib's own layout measures each text twice, which took half of the time."""
    width, height = figure.get_size_inches()
    bottom = 0.55 + (0.18 * rows + 0.1 if rows else 0.0)
    figure.subplots_adjust(
        left=0.8 / width,
        right=1.0 - 0.12 / width,
        bottom=bottom / height,
        top=1.0 - (0.32 if titled else 0.1) / height,
    )


def _draw(
    axes: Any, curve: Curve, number: int, above: int
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Draw a curve of colour `number`, with `above` curves over it; return the points that can be
    shown."""
    x, y = (np.asarray(values, dtype=np.float64) for values in (curve.x, curve.y))
    colour = PALETTE[number % len(PALETTE)]
    fits = np.isfinite(x) & (x > 0.0)
    if curve.low is not None and curve.high is not None:
        low, high = (np.asarray(values, dtype=np.float64) for values in (curve.low, curve.high))
        banded = fits & np.isfinite(high) & (high > 0.0)
        floor = np.finfo(np.float32).tiny  # below all that is shown
        low = np.where(low > floor, low, floor)
        axes.fill_between(
            x[banded], low[banded], high[banded], color=colour, alpha=0.18, linewidth=0.0
        )
    fits &= np.isfinite(y) & (y > 0.0)
    above = min(above, 4)
    axes.plot(
        x[fits],
        y[fits],
        color=colour,
        linewidth=1.1 if curve.dashed else 1.3 + 0.6 * above,
        linestyle="--" if curve.dashed else "-",
        marker=MARKERS[number % len(MARKERS)] if curve.marked else None,
        markersize=4.5 + 1.6 * above,
        markerfacecolor="none",
        markeredgewidth=1.3,
        clip_on=False,  # the limits are around the points
        label=curve.name or "_",
    )
    return x[fits], y[fits]


def _limit(
    axes: Any,
    drawn: Sequence[tuple[npt.NDArray[Any], npt.NDArray[Any]]],
    levels: Mapping[str, float],
) -> None:
    """Set the limits from the points alone: a band without a lower end would fill the plot."""
    if not drawn:
        return
    for k, set_limits in enumerate((axes.set_xlim, axes.set_ylim)):
        values = np.concatenate([points[k] for points in drawn])
        low, high = math.log10(values.min()), math.log10(values.max())
        margin = max(0.05 * (high - low), 0.08)
        set_limits(10.0 ** (low - margin), 10.0 ** (high + margin))
    low, high = axes.get_ylim()
    near = [y for y in levels.values() if low / 10.0 <= y <= high * 10.0]
    axes.set_ylim(min([low, *(y / 1.2 for y in near)]), max([high, *(y * 1.5 for y in near)]))


def _ticks(axis: Any, most: int) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    low, high = axis.get_view_interval()
    decades = math.log10(high / low)
    steps = [1.0, 2.0, 5.0] if decades < 2.0 else [1.0]
    if decades < 0.7:
        steps += [1.2, 1.5, 2.5, 3.0, 4.0, 6.0, 7.0, 8.0, 9.0]
    axis.set_major_locator(LogLocator(subs=steps, numticks=most))
    axis.set_major_formatter(FuncFormatter(lambda value, _: power_of_ten(value)))
    axis.set_minor_formatter(NullFormatter())
    if decades > 8.0:  # minor ticks would touch each other, and each takes time
        axis.set_minor_locator(NullLocator())


def _inline(svg: str, title: str) -> str:
    """The <svg> element alone, in the page's text colour, with ids and style of its own."""
    svg = svg[svg.index("<svg") :].strip().replace(_INK, "currentColor")
    own = "p" + hashlib.sha256(svg.encode()).hexdigest()[:10] + "-"
    svg = re.sub(r'(\bid="|xlink:href="#|url\(#)', rf"\g<1>{own}", svg)
    svg = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>", "", svg, count=1, flags=re.DOTALL)
    style = "max-width: 100%; height: auto; stroke-linejoin: round; stroke-linecap: butt"
    attributes = f'role="img" aria-label="{escape(title)}" style="{style}"'
    return svg.replace("<svg ", f"<svg {attributes} ", 1)


_SIZE = re.compile(r'height="[^"]*pt" viewBox="0 0 ([0-9.]+) ([0-9.]+)"')


def source_of(facts: Mapping[str, Any]) -> str:
    """The command of this process, and the machine and the date of a provenance."""
    command = shlex.join(["reference-rt", *sys.argv[1:]])
    return f"{command}; {facts['machine']}, {facts['cores']} cores, {str(facts['date'])[:10]}"


def save(folder: Path, plots: Mapping[str, str], facts: Mapping[str, Any]) -> None:
    """Write plots as SVG files, black on white, with their `source_of` below.

    plots: <svg> elements by the names of their files, without suffix.
    """
    lines = textwrap.wrap(source_of(facts), 90, break_on_hyphens=False)
    for name, svg in plots.items():
        if (size := _SIZE.search(svg)) is None:
            raise ValueError(f"{name}: expected a plot of `log_log`")
        width, height = size[1], float(size[2])
        text = "".join(
            f'<text x="8" y="{height + 8 + 12 * k}" style="font: 9px sans-serif">'
            f"{escape(line)}</text>"
            for k, line in enumerate(lines)
        )
        below = f'height="{height + 12 * len(lines)}pt" viewBox="0 0 {width} '
        svg = svg.replace(size[0], f'{below}{height + 12 * len(lines)}"', 1)
        svg = svg.replace('style="', 'style="background: white; ', 1).replace(
            "</svg>", f"{text}</svg>"
        )
        write(folder / f"{re.sub('[^a-zA-Z0-9_]+', '-', name)}.svg", svg)

"""One HTML page about a run: offline, a single file, what failed comes first.

The page asks for nothing beyond itself (its content security policy forbids it), so it can be
kept, mailed, or opened from disk. All text is escaped: names of scenes come from outside.
"""

import base64
import io
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from jinja2 import Environment, PackageLoader, StrictUndefined
from PIL import Image

from comparisons.metrics import encode, nonfinite_pixels, white_level
from comparisons.results import RUNGS, Case, FloatArray, Images, Metrics, Status
from reference_rt.files import replacing

ORDER: tuple[Status, ...] = (
    "invalid",
    "differ",
    "inconclusive",
    "not-comparable",
    "not-applicable",
    "reference-limited",
    "agree",
)
"""What needs attention comes first."""

SIGNS: dict[Status, str] = {
    "invalid": "!",
    "differ": "✗",
    "inconclusive": "?",
    "not-comparable": "–",
    "not-applicable": "–",
    "reference-limited": "≈",
    "agree": "✓",
}
"""Beside the word of a verdict, which a reader need then not tell by its colour."""

DIFFERENCE_PERCENTILE = 99.5
"""Where the difference's colours end: a few fireflies may saturate, the rest stays visible."""

PICTURE_WIDTH = 400
"""CSS pixels of a column of pictures; smaller pictures are enlarged by a whole factor up to it."""

MAGENTA = (255, 0, 255)
RED, WHITE, BLUE = (178, 24, 43), (255, 255, 255), (33, 102, 172)
"""Ends and middle of ColorBrewer's RdBu, which colour-blind readers can tell apart."""

SHOWN_ITEMS = 8
"""Of a list of numbers; `results.json` has them all."""


@dataclass(frozen=True)
class Picture:
    """A picture as the page shows it."""

    url: str
    """data: URL of a PNG"""
    width: int
    height: int
    """CSS pixels"""
    enlarged: bool
    nonfinite: int


@dataclass(frozen=True)
class Pictures:
    ours: Picture
    mitsuba: Picture
    difference: Picture | None
    """None if the pictures are of unlike size."""
    white: float
    """Radiance shown as white."""
    scale: float
    """Radiance difference shown as full red or blue; 0 if the pictures are equal."""


def write_report(path: Path, cases: Sequence[Case], provenance: Mapping[str, Any]) -> None:
    """Write the page about `cases`, at once or not at all.

    `provenance` is shown as it comes: the caller names versions, Mitsuba's variant and why it was
    chosen, the machine and the date. In the numbers of a tier, a name that ends in `_bias` means
    a fraction and is shown in percent; nested mappings and lists are shown in line.
    """
    environment = Environment(
        loader=PackageLoader("comparisons", "report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"shown": shown, "label": label, "percent": percent}
    ranked = sorted(cases, key=lambda case: ORDER.index(case.verdict))
    counts = Counter(case.verdict for case in cases)
    page = environment.get_template("page.html.jinja").render(
        counts=[(status, counts[status]) for status in ORDER if counts[status]],
        signs=SIGNS,
        provenance=provenance,
        cases=[_view(case) for case in ranked],
    )
    with replacing(path) as temporary:
        temporary.write_text(page, encoding="utf-8", newline="\n")


def shown(value: Any, name: str = "") -> str:
    """A value for people: four digits, powers of ten, percent where `name` ends in `_bias`."""
    match value:
        case None:
            return "–"
        case bool() | np.bool_():
            return "yes" if value else "no"
        case int() | np.integer():
            return f"{int(value):,}"
        case float() | np.floating():
            return percent(float(value)) if name.endswith("_bias") else _real(float(value))
        case Mapping():
            return ", ".join(f"{label(key)} {shown(item, name)}" for key, item in value.items())
        case np.ndarray():
            return shown(value.tolist(), name)
        case list() | tuple():
            rest = f", … ({len(value)} in all)" if len(value) > SHOWN_ITEMS else ""
            return ", ".join(shown(item, name) for item in value[:SHOWN_ITEMS]) + rest
        case _:
            return str(value)


def percent(fraction: float) -> str:
    """Three digits of a percentage."""
    return f"{_real(100.0 * fraction, '.3g')} %" if math.isfinite(fraction) else _real(fraction)


def label(name: object) -> str:
    """`worst_tile_x` -> `worst tile x`"""
    return str(name).replace("_", " ")


def _real(value: float, format_: str = ".4g") -> str:
    if math.isnan(value):
        return "undefined"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    mantissa, _, exponent = f"{value:{format_}}".replace("-", "−").partition("e")
    if not exponent:
        return mantissa
    digits = str(int(exponent.replace("−", "-")))
    return f"{mantissa} × 10{digits.translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}"


def _view(case: Case) -> dict[str, Any]:
    """What the template shows of a case."""
    ladder = sorted(case.tiers, key=lambda tier: RUNGS.index(tier.name))
    stages = dict.fromkeys(stage for times in case.seconds.values() for stage in times)
    return {
        "case": case,
        "tiers": ladder,
        "pictures": _pictures(case.images) if case.images else None,
        "metrics": _metric_rows(case.metrics) if case.metrics else [],
        "stages": list(stages),
        "totals": {who: sum(times.values()) for who, times in case.seconds.items()},
    }


def _metric_rows(metrics: Metrics) -> list[tuple[str, str]]:
    return [
        ("SSIM", shown(metrics.ssim)),
        ("PSNR, dB", shown(metrics.psnr)),
        ("RMSE, W·sr⁻¹·m⁻²", shown(metrics.rmse)),
        ("relMSE", shown(metrics.relmse)),
        ("Mean bias", shown(dict(zip("RGB", metrics.mean_bias, strict=True)), "mean_bias")),
        ("Pixels not finite", shown(metrics.nonfinite)),
    ]


def _pictures(images: Images) -> Pictures:
    white = white_level(images.mitsuba)
    scale, difference = 0.0, None
    if images.ours.shape == images.mitsuba.shape:
        scale, difference = _difference(images)
    return Pictures(
        ours=_exposed(images.ours, white),
        mitsuba=_exposed(images.mitsuba, white),
        difference=difference,
        white=white,
        scale=scale,
    )


def _exposed(image: FloatArray, white: float) -> Picture:
    bad = nonfinite_pixels(image)
    return _picture(255.0 * encode(np.where(bad[..., None], 0.0, image), white), bad)


def _difference(images: Images) -> tuple[float, Picture]:
    """Ours minus Mitsuba's in the channel that differs most, so that no two channels cancel."""
    bad = nonfinite_pixels(images.ours, images.mitsuba)
    ours, mitsuba = (np.where(bad[..., None], 0.0, i) for i in (images.ours, images.mitsuba))
    error = ours - mitsuba
    most = np.abs(error).argmax(axis=-1)[..., None]
    signed = np.take_along_axis(error, most, axis=-1)
    sizes = np.abs(signed)
    # The largest difference where fewer than 0.5 % of the pixels differ at all.
    scale = float(np.percentile(sizes, DIFFERENCE_PERCENTILE)) or float(sizes.max())
    amount = np.clip(signed, -scale, scale) / (scale or 1.0)
    end = np.where(amount > 0.0, RED, BLUE)
    return scale, _picture(WHITE + np.abs(amount) * (end - np.array(WHITE)), bad)


def _picture(values: FloatArray, bad: npt.NDArray[np.bool_]) -> Picture:
    """Pixels of 0 to 255, the bad ones in magenta."""
    pixels = np.rint(values).astype(np.uint8)
    pixels[bad] = MAGENTA
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG", optimize=True)
    height, width = bad.shape
    factor = max(1, PICTURE_WIDTH // width)
    return Picture(
        url="data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii"),
        width=width * factor,
        height=height * factor,
        enlarged=width < PICTURE_WIDTH,
        nonfinite=int(np.count_nonzero(bad)),
    )

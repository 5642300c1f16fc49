"""Thumbnails of a case's pictures, shown without JavaScript, as PNGs inside the page."""

import base64
import io
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image

from comparisons.report.pictures_data import reduced
from comparisons.results.case import Case, FloatArray, Images
from comparisons.statistics.metrics import (
    count_nonfinite,
    encode,
    local_errors,
    nonfinite_pixels,
    white_level,
)

DIFFERENCE_PERCENTILE = 99.5
"""End of the difference's colour scale: a few fireflies may saturate, the rest stays visible."""

LONGEST = 64
"""Pixels of the longer side of a thumbnail, at most; what a script shows is larger."""

MAGENTA = (255, 0, 255)
RED, WHITE, BLUE = (178, 24, 43), (255, 255, 255), (33, 102, 172)
"""Ends and middle of ColorBrewer's RdBu, which colour-blind readers can tell apart."""


@dataclass(frozen=True)
class Thumbnail:
    url: str
    """data: URL of a PNG"""
    width: int
    height: int
    """of the full picture"""
    nonfinite: int
    """pixels of the full picture that are not finite"""


@dataclass(frozen=True)
class Thumbnails:
    candidate: Thumbnail
    reference: Thumbnail
    difference: Thumbnail | None
    """None if the pictures differ in size."""
    white: float
    """Radiance shown as white: the 99th percentile of the reference's pixels that are not black."""
    span: float
    """Radiance difference shown as full red or blue; 0 if the pictures are equal."""


def thumbnails(images: Images, is_signed: bool = False, longest: int = LONGEST) -> Thumbnails:
    """is_signed: of values of both signs, whose sizes the white level is of: they are shown from
    blue to red;  longest: pixels of the longer side, at most."""
    white = white_level(np.abs(images.reference) if is_signed else images.reference)
    shown = _signed if is_signed else _exposed
    span, difference = 0.0, None
    if images.candidate.shape == images.reference.shape:
        span, difference = _difference(images, longest)
    return Thumbnails(
        candidate=shown(images.candidate, white, longest),
        reference=shown(images.reference, white, longest),
        difference=difference,
        white=white,
        span=span,
    )


def small_pictures(case: Case) -> list[tuple[str, str]]:
    """URLs and titles of both pictures and of their difference; none without pictures."""
    images = case.images
    if images is None or not images.candidate.size or not images.reference.size:
        return []
    found = thumbnails(images, case.is_signed)
    pictures = [(found.candidate.url, case.sides[0]), (found.reference.url, case.sides[1])]
    return pictures + ([(found.difference.url, "difference")] if found.difference else [])


def of_others(images: Images, sides: tuple[str, str]) -> list[tuple[Thumbnail, str]]:
    """Other renderers' pictures, and what each of the two differs from them, with titles."""
    found = []
    for whose, other in images.others.items():
        found.append((_exposed(other, white_level(images.reference)), whose))
        for picture, side in zip((images.candidate, images.reference), sides, strict=True):
            span, difference = _difference(Images(picture, other))
            found.append((difference, f"{side} − {whose}, −{span:.2g} to +{span:.2g}"))
    return found


def _exposed(image: FloatArray, white: float, longest: int = LONGEST) -> Thumbnail:
    small = _shrunk(image, longest)
    bad = nonfinite_pixels(small)
    pixels = 255.0 * encode(np.where(bad[..., None], 0.0, small), white)
    return _thumbnail(pixels, bad, image.shape, count_nonfinite(image))


def _difference(images: Images, longest: int = LONGEST) -> tuple[float, Thumbnail]:
    """Candidate minus reference in the channel that differs most, so that no two cancel."""
    with np.errstate(invalid="ignore", over="ignore"):
        difference = images.candidate - images.reference
    sizes = np.abs(_largest(difference))
    sizes = sizes[np.isfinite(sizes)]
    # If fewer than 0.5 % of the pixels differ at all, the percentile is 0: take the largest.
    span = float(np.percentile(sizes, DIFFERENCE_PERCENTILE) or sizes.max()) if sizes.size else 0.0
    nonfinite = count_nonfinite(images.candidate, images.reference)
    return span, replace(_signed(difference, span, longest), nonfinite=nonfinite)


def _signed(image: FloatArray, span: float, longest: int) -> Thumbnail:
    """From blue at -span over white to red at span, of the channel farthest from zero."""
    small = _shrunk(image, longest)
    bad = nonfinite_pixels(small)
    amount = np.clip(_largest(np.where(bad[..., None], 0.0, small)), -span, span) / (span or 1.0)
    end = np.where(amount > 0.0, RED, BLUE)
    pixels = WHITE + np.abs(amount) * (end - np.array(WHITE))
    return _thumbnail(pixels, bad, image.shape, count_nonfinite(image))


def _largest(difference: FloatArray) -> FloatArray:
    """(h, w, 3) -> (h, w, 1): the value of the channel farthest from zero."""
    most = np.abs(difference).argmax(axis=-1)[..., None]
    return np.take_along_axis(difference, most, axis=-1)


def _shrunk(image: FloatArray, longest: int) -> FloatArray:
    return reduced(image, -(-max(image.shape) // longest))


def _thumbnail(
    values: FloatArray, bad: npt.NDArray[np.bool_], shape: tuple[int, ...], nonfinite: int
) -> Thumbnail:
    """Pixels of 0 to 255, the bad ones in magenta."""
    url = png_url(np.where(bad[..., None], MAGENTA, values))
    return Thumbnail(url, shape[1], shape[0], nonfinite)


def png_url(pixels: FloatArray) -> str:
    """The data: URL of a PNG of pixels (height, width, 3) from 0 to 255, which are rounded."""
    buffer = io.BytesIO()
    Image.fromarray(np.rint(pixels).astype(np.uint8)).save(buffer, "PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")


def decoded(url: str) -> npt.NDArray[np.uint8]:
    """What a PNG of such a URL shows (height, width, 3)."""
    data = base64.b64decode(url.partition(",")[2])
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))


def shrunk_url(path: Path, longest: int = 4 * LONGEST) -> str:
    """The data: URL of a picture's file, made smaller."""
    with Image.open(path) as image:
        image.thumbnail((longest, longest))
        return png_url(np.asarray(image.convert("RGB"), np.float64))


# ---- the FLIP map of a case: where the pictures look different to people, as a PNG ---------------


LONGEST_MAP = 128
"""Pixels of the map's longer side, at most: a page of 64 cases must not grow beyond its limit."""

VIRIDIS = np.array(
    [
        *([68, 1, 84], [72, 24, 106], [71, 45, 123], [66, 64, 134], [59, 82, 139], [51, 99, 141]),
        *([44, 114, 142], [38, 130, 142], [33, 145, 140], [31, 160, 136], [40, 174, 128]),
        *([63, 188, 115], [94, 201, 98], [132, 212, 75], [173, 220, 48], [216, 226, 25]),
        [253, 231, 37],
    ],
    np.float64,
)
"""The map viridis (van der Walt and Smith 2015, CC0) at multiples of 1/16, as in colour.js."""


def flip_map(images: Images) -> tuple[Thumbnail, float] | None:
    """The map and the value at the bright end of its scale; None for pictures that differ in size
    or have values that are not finite, of which FLIP is undefined."""
    a, b = images.candidate, images.reference
    if a.shape != b.shape or not a.size or np.asarray(nonfinite_pixels(a, b)).any():
        return None
    with np.errstate(all="ignore"):
        flip = local_errors(Images(a, b)).flip
    if not np.isfinite(flip).all():
        return None
    height, width = flip.shape
    small = reduced(flip[..., None], -(-max(height, width) // LONGEST_MAP))[..., 0]
    end = float(small.max())
    share = small / end if end > 0.0 else np.zeros_like(small)
    return Thumbnail(_url(np.rint(255.0 * share).astype(np.uint8)), width, height, 0), end


def _palette() -> bytes:
    """256 colours, from dark to bright."""
    at = np.linspace(0.0, 16.0, 256)
    colours = [np.interp(at, range(17), channel) for channel in VIRIDIS.T]
    return bytes(np.rint(np.column_stack(colours)).astype(np.uint8).tobytes())


def _url(index: npt.NDArray[np.uint8]) -> str:
    """The data: URL of a PNG with a palette: a third of the size of one with colours."""
    image = Image.fromarray(index, "L")
    image.putpalette(_palette())
    buffer = io.BytesIO()
    image.save(buffer, "PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")

"""The FLIP map of a case: where the pictures look different to people, as a PNG."""

import base64
import io

import numpy as np
import numpy.typing as npt
from PIL import Image

from comparisons.report.pictures_data import reduced
from comparisons.report.thumbnails import Thumbnail
from comparisons.results.case import Images
from comparisons.statistics.metrics import local_errors, nonfinite_pixels

LONGEST = 128
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
    small = reduced(flip[..., None], -(-max(height, width) // LONGEST))[..., 0]
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

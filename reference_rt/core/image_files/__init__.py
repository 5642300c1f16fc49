"""Reading image files: `open_image` detects the format and reads the header.

Bitmap textures, environment maps and the image gate read with these.  The format is detected by a
file's first bytes, not by its name.  A format's `open_*` function returns an `ImageFile` with size
and properties; its `strips` yields the pixels, float64, a few rows at a time.  Invalid files raise
ValueError (what is wrong; what was expected) without the path, which callers add; files that cannot
be opened raise OSError.

To add a format: a module with a subclass of `ImageFile` and an `open_*` function; its first bytes
in `_BEGINNINGS`; a test with files of it.
"""

import os
from pathlib import Path

from reference_rt.core.image_files.exr import open_exr
from reference_rt.core.image_files.float_files import HdrFile, open_hdr, open_npy, open_pfm
from reference_rt.core.image_files.image_file import HEADER, Beginning, ImageFile, Strip
from reference_rt.core.image_files.pillow import open_with_pillow
from reference_rt.util.files import open_input

__all__ = ["HdrFile", "ImageFile", "Strip", "open_image"]

_BEGINNINGS = (
    (b"v/1\x01", open_exr),
    (b"PF", open_pfm),
    (b"Pf", open_pfm),
    (b"\x93NUMPY", open_npy),
)


def open_image(path: Path, layer: str = "", radiance: bool = False) -> ImageFile:
    """The image in a file, of which only the header has been read.

    layer: the prefix of the channels' names of an EXR file;  radiance: decode .hdr as Radiance
    itself does, see `HdrFile`.  Raises ValueError (what is wrong, what was expected) and
    OSError.
    """
    with open_input(path) as opened:
        start = opened.read(HEADER + 64)
        file = Beginning(path, start, os.fstat(opened.fileno()).st_size)
    if not start:
        raise ValueError("is empty; expected an image")
    if layer and not start.startswith(_BEGINNINGS[0][0]):
        raise ValueError(f"has no layer '{layer}'; expected an .exr file, or no 'layer'")
    if layer:
        return open_exr(file, layer)
    if start.startswith(b"#?"):
        return open_hdr(file, radiance)
    reader = next((open_ for beginning, open_ in _BEGINNINGS if start.startswith(beginning)), None)
    found = (reader or open_with_pillow)(file)
    if min(found.width, found.height) < 1:
        raise ValueError(f"has {found.width} x {found.height} pixels; expected at least one")
    return found

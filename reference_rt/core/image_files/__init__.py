"""Reading image files: `open_image` detects the format and reads the header.

Bitmap textures, environment maps and the image gate read with these.  The format is detected by a
file's first bytes, not by its name.  A format's `open_*` function returns an `ImageFile` with size
and properties; its `strips` yields the pixels, float64, a few rows at a time.  Invalid files raise
ValueError (what is wrong; what was expected) without the path, which callers add; files that cannot
be opened raise OSError.

To add a format: a module with a subclass of `ImageFile` and an `open_*` function; its first bytes
in `_BEGINNINGS`; a test with files of it.
"""

from pathlib import Path

from reference_rt.core.image_files.exr import open_exr
from reference_rt.core.image_files.float_files import HdrFile, open_hdr, open_npy, open_pfm
from reference_rt.core.image_files.image_file import ImageFile, Strip
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
    with open_input(path) as file:
        start = file.read(16)
    if not start:
        raise ValueError("is empty; expected an image")
    if layer and not start.startswith(_BEGINNINGS[0][0]):
        raise ValueError(f"has no layer '{layer}'; expected an .exr file, or no 'layer'")
    if layer:
        return open_exr(path, layer)
    if start.startswith(b"#?"):
        return open_hdr(path, radiance)
    reader = next((open_ for beginning, open_ in _BEGINNINGS if start.startswith(beginning)), None)
    found = open_with_pillow(path) if reader is None else reader(path)
    if min(found.width, found.height) < 1:
        raise ValueError(f"has {found.width} x {found.height} pixels; expected at least one")
    return found

"""OpenEXR images: half, float or integer channels R, G, B, or Y."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from reference_rt.core.exr import read_header, read_planes
from reference_rt.core.image_files.image_file import Curve, ImageFile, Strip, as_float64


@dataclass(frozen=True)
class ExrFile(ImageFile):
    """names: the channels for red, green, blue and, where there is one, opacity;  channels: the
    number of all channels in the file;  windows: corners (x0, y0, x1, y1) of the data window and of
    the display window."""

    names: tuple[str, ...] = ()
    channels: int = 0
    windows: tuple[tuple[int, ...], tuple[int, ...]] = ((), ())

    def strips(self, curve: Curve | None = None, with_opacity: bool = False) -> Iterator[Strip]:
        planes = read_planes(self.path)
        names = self.names if with_opacity else self.names[:3]
        wanted = {name: planes[name] for name in names}
        del planes
        if {plane.shape for plane in wanted.values()} != {(self.height, self.width)}:
            raise ValueError("cannot be read as EXR: expected channels of one size")
        if any(plane.dtype.kind not in "fu" for plane in wanted.values()):
            raise ValueError("cannot be read as EXR: it has deep pixels; expected flat ones")
        for rows in reversed(list(self.row_ranges())):
            found = [as_float64(wanted[name][rows]) for name in names]
            colours = np.stack(found[:3], axis=-1)
            colours = colours if curve is None else curve(colours)
            yield Strip(rows, colours, found[3] if len(found) > 3 else None)
            del found, colours
            # Frees the rows that have been converted: float32 planes and their float64 values
            # together would take 36 bytes per pixel.
            for plane in wanted.values():
                if plane.flags.owndata:
                    plane.resize((rows.start, self.width), refcheck=False)


def open_exr(path: Path, layer: str = "") -> ImageFile:
    """layer: the prefix of the channels' names, such as "diffuse" for diffuse.R.  Raises
    ValueError (what is wrong, what was expected)."""
    header = read_header(path)
    kinds = [channel.name for channel in header["channels"]]
    prefix = f"{layer}." if layer else ""
    if all(prefix + name in kinds for name in "RGB"):
        names = [prefix + name for name in "RGB"]
    elif prefix + "Y" in kinds and prefix + "RY" not in kinds:  # with which it is in colour
        names = 3 * [prefix + "Y"]
    else:
        expected = ", ".join(prefix + name for name in "RGB")
        raise ValueError(f"has channels {_list(kinds)}; expected {expected}, or {prefix}Y")
    has_opacity = prefix + "A" in kinds
    (x0, y0, x1, y1), display = (_corners(header[n]) for n in ("dataWindow", "displayWindow"))
    return ExrFile(
        path,
        x1 - x0 + 1,
        y1 - y0 + 1,
        has_opacity=has_opacity,
        text={key: value for key, value in header.items() if isinstance(value, str)},
        names=(*names, *([prefix + "A"] if has_opacity else [])),
        channels=len(kinds),
        windows=((x0, y0, x1, y1), display),
    )


def _corners(window: Any) -> tuple[int, ...]:
    return tuple(int(n) for corner in window for n in corner)


def _list(names: Any, most: int = 12) -> str:
    names = sorted(names)
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more

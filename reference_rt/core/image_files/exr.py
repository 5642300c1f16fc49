"""OpenEXR images: half, float or integer channels R, G, B, or Y."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from reference_rt.core.exr import read_header, read_planes
from reference_rt.core.image_files.image_file import ImageFile, StoredStrip


@dataclass(frozen=True)
class ExrFile(ImageFile):
    """names: the channels for red, green, blue, or for grey, and for opacity if there is one;
    channels: the number of all channels in the file;  windows: corners (x0, y0, x1, y1) of the data
    window and of the display window."""

    names: tuple[str, ...] = ()
    channels: int = 0
    windows: tuple[tuple[int, ...], tuple[int, ...]] = ((), ())

    def stored(self, with_opacity: bool = False) -> Iterator[StoredStrip]:
        planes = read_planes(self.path)
        names = self.names if with_opacity else self.names[: 1 if self.is_grey else 3]
        wanted = {name: planes[name] for name in names}
        del planes
        if {plane.shape for plane in wanted.values()} != {(self.height, self.width)}:
            raise ValueError("cannot be read as EXR: expected channels of one size")
        if any(plane.dtype.kind not in "fu" for plane in wanted.values()):
            raise ValueError("cannot be read as EXR: it has deep pixels; expected flat ones")
        kinds = {plane.dtype.name for plane in wanted.values()}
        kind = "float64" if "uint32" in kinds else "float32" if "float32" in kinds else "float16"
        colours = 1 if self.is_grey else 3
        for rows in reversed(list(self.row_ranges())):
            with np.errstate(invalid="ignore"):  # signalling NaNs
                found = [wanted[name][rows].astype(kind) for name in names]
            opacity = found[colours] if len(found) > colours else None
            yield StoredStrip(rows, np.stack(found[:colours], axis=-1), opacity)
            del found
            # Frees the rows that have been converted: planes and all that they become together
            # would take more than is allowed.
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
        names = [prefix + "Y"]
    else:
        expected = ", ".join(prefix + name for name in "RGB")
        raise ValueError(f"has channels {_list(kinds)}; expected {expected}, or {prefix}Y")
    has_opacity = prefix + "A" in kinds
    (x0, y0, x1, y1), display = (_corners(header[n]) for n in ("dataWindow", "displayWindow"))
    return ExrFile(
        path,
        x1 - x0 + 1,
        y1 - y0 + 1,
        "float64",  # the library tells the type of channels only with their pixels
        is_grey=len(names) == 1,
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

"""OpenEXR images: half, float or integer channels R, G, B, one channel of grey, or luminance and
chroma; of deep pixels the first sample.

A renderer writes several pictures into one file, as layers, whose channels have a prefix
(`diffuse.R`), and as parts.  Read are, of the first part that has it: the layer that is asked for;
else R, G, B, or Y, RY, BY, or Y without a prefix; else the only layer that has these; else the only
channel."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from reference_rt.core.exr import read_headers, read_planes
from reference_rt.core.image_files.deep_exr import first_samples
from reference_rt.core.image_files.image_file import Beginning, ImageFile, StoredStrip
from reference_rt.core.image_files.luminance_chroma import REC709, colours, luminance_weights


@dataclass(frozen=True)
class ExrFile(ImageFile):
    """part: the number of the file's part;  names: the channels for red, green, blue, or for grey,
    and for opacity if there is one;  channels: the number of all channels in the part;  windows:
    corners (x0, y0, x1, y1) of the data window and of the display window;  chromaticities: of the
    primaries of luminance and chroma, () for other channels;  is_deep: whether pixels have several
    samples."""

    part: int = 0
    names: tuple[str, ...] = ()
    channels: int = 0
    windows: tuple[tuple[int, ...], tuple[int, ...]] = ((), ())
    chromaticities: tuple[float, ...] = ()
    is_deep: bool = False

    def stored(self, with_opacity: bool = False) -> Iterator[StoredStrip]:
        names = self.names if with_opacity else self.names[: 1 if self.is_grey else 3]
        if self.is_deep:
            header = read_headers(self.path)[self.part]
            wanted = first_samples(self.path, header, (self.width, self.height), names)
        else:
            planes = read_planes(self.path, self.part)
            wanted = {name: planes[name] for name in names}
            del planes
        whole = self.height, self.width
        if self.chromaticities:
            yield from self._from_chroma(wanted, names)
            return
        if {plane.shape for plane in wanted.values()} != {whole}:
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

    def _from_chroma(self, planes: dict[str, Any], names: Sequence[str]) -> Iterator[StoredStrip]:
        weights = luminance_weights(self.chromaticities)
        luminance, red, blue, *opacity = (planes[name] for name in names)
        sizes = {n: {n, n // 2} if n % 2 == 0 else {n} for n in (self.height, self.width)}
        if (
            any(plane.shape != (self.height, self.width) for plane in (luminance, *opacity))
            or red.shape != blue.shape
            or red.shape[0] not in sizes[self.height]
            or red.shape[1] not in sizes[self.width]
            or any(plane.dtype.kind != "f" for plane in planes.values())
        ):
            raise ValueError("cannot be read as EXR: expected chroma of every second pixel")
        for rows in self.row_ranges():
            with np.errstate(invalid="ignore", over="ignore"):
                found = colours(luminance, red, blue, rows, weights)
                covered = opacity[0][rows].astype(np.float32) if opacity else None
            yield StoredStrip(rows, found, covered)


def open_exr(file: Beginning, layer: str = "") -> ImageFile:
    """layer: the prefix of the channels' names, such as "diffuse" for diffuse.R; "" for the file's
    only one.  Raises ValueError (what is wrong, what was expected)."""
    headers = read_headers(file.path)
    parts = [[channel.name for channel in header["channels"]] for header in headers]
    part, names = _chosen(parts, layer)
    header, kinds = headers[part], parts[part]
    opacity = names[0][:-1] + ("a" if names[0].endswith("r") else "A")
    has_opacity = opacity in kinds and opacity not in names
    is_deep = "deep" in str(header.get("type", ""))
    in_chroma = names[1:2] and names[1].endswith("RY")
    chromaticities = tuple(float(x) for x in header.get("chromaticities", REC709))
    if in_chroma and len(chromaticities) != 8:
        raise ValueError("cannot be read as EXR: it is damaged; expected eight chromaticities")
    (x0, y0, x1, y1), display = (_corners(header[n]) for n in ("dataWindow", "displayWindow"))
    return ExrFile(
        file.path,
        x1 - x0 + 1,
        y1 - y0 + 1,
        "float64",  # the library tells the type of channels only with their pixels
        is_grey=len(names) == 1,
        has_opacity=has_opacity,
        part=part,
        text={key: value for key, value in header.items() if isinstance(value, str)},
        names=(*names, *([opacity] if has_opacity else [])),
        channels=len(kinds),
        windows=((x0, y0, x1, y1), display),
        chromaticities=chromaticities if in_chroma else (),
        is_deep=is_deep,
        note="has deep pixels, of which the first samples are read" if is_deep else "",
    )


def _chosen(parts: Sequence[Sequence[str]], layer: str) -> tuple[int, list[str]]:
    """The number of the part, and its channels for red, green and blue, or for grey.

    parts: the names of the channels of each.  Raises ValueError, which names the layers there are.
    """
    pictures: dict[str, tuple[int, list[str]]] = {}
    for number, kinds in enumerate(parts):
        for kind in kinds:
            prefix, last = kind[:-1], kind[-1:]
            if prefix and not prefix.endswith("."):
                continue
            if last in "Rr" and all(prefix + name in kinds for name in _after(last)):
                pictures.setdefault(prefix, (number, [kind, *(prefix + n for n in _after(last))]))
            elif last == "Y" and {prefix + "RY", prefix + "BY"} <= {*kinds}:
                pictures.setdefault(prefix, (number, [kind, prefix + "RY", prefix + "BY"]))
            elif last in "Yy" and prefix + "RY" not in kinds:
                pictures.setdefault(prefix, (number, [kind]))
    alone = [(number, list(kinds)) for number, kinds in enumerate(parts) if len(kinds) == 1]
    every = sorted({kind for kinds in parts for kind in kinds})
    if layer:
        if f"{layer}." in pictures:
            return pictures[f"{layer}."]
        raise ValueError(
            f"has channels {_list(every)}; expected {layer}.R, {layer}.G, {layer}.B, or {layer}.Y"
        )
    if "" in pictures:
        return pictures[""]
    if len(pictures) == 1:
        return next(iter(pictures.values()))
    if pictures:
        raise ValueError(
            f"has several pictures; expected `layer` as one of: "
            f"{_list([prefix.removesuffix('.') for prefix in pictures])}"
        )
    if len(alone) == 1 and len(parts) == 1:
        return alone[0]
    raise ValueError(f"has channels {_list(every)}; expected R, G, B, or Y")


def _after(red: str) -> str:
    return "GB" if red == "R" else "gb"


def _corners(window: Any) -> tuple[int, ...]:
    return tuple(int(n) for corner in window for n in corner)


def _list(names: Any, most: int = 12) -> str:
    names = sorted(names)
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more

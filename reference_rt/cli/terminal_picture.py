"""Pictures as text for terminals: half blocks in 24-bit colour, sixels, or kitty's protocol.

A half block, U+2580, shows two pixels in one cell: the upper one is its foreground, the lower one
its background.  Sixels (DEC VT340, 1987) are bands of six rows in up to 256 colours, which xterm,
mlterm, foot, WezTerm, Windows Terminal and others draw as pixels.  Kitty's graphics protocol,
https://sw.kovidgoyal.net/kitty/graphics-protocol/, takes PNG files; Ghostty, Konsole and WezTerm
have it, too.
"""

import base64
import io
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress

import numpy as np
import numpy.typing as npt

Pixels = npt.NDArray[np.uint8]

CELL = (8, 16)
"""Width and height of a cell in pixels, where the terminal does not say."""

_CHUNK = 4096
"""Characters of kitty's protocol that a terminal takes at once."""

_COLOURS, _PALETTE_OF = 256, 96
"""Colours of a palette, and pixels of a side that it is made of at most: of all pixels it takes
five times as long, and is off by a tenth less."""


def half_blocks(pixels: Pixels, columns: int, rows: int) -> str:
    """(height, width, 3) pixels as lines of half blocks, scaled down to fit into the terminal."""
    small = fitted(pixels, columns, 2 * rows)
    if len(small) % 2:
        small = np.concatenate([small, np.zeros_like(small[:1])])
    lines = []
    for upper, lower in zip(small[0::2], small[1::2], strict=True):
        cells = (
            f"\x1b[38;2;{a[0]};{a[1]};{a[2]};48;2;{b[0]};{b[1]};{b[2]}m▀"
            for a, b in zip(upper.tolist(), lower.tolist(), strict=True)
        )
        lines.append("".join(cells) + "\x1b[0m")
    return "\n".join(lines) + "\n"


def sixels(pixels: Pixels, columns: int, rows: int) -> str:
    """(height, width, 3) pixels as sixels, scaled down to fit into the terminal."""
    return _at_cursor(in_sixels, pixels, columns, rows)


def kitty(pixels: Pixels, columns: int, rows: int) -> str:
    """(height, width, 3) pixels by kitty's protocol, scaled down to fit into the terminal."""
    return _at_cursor(lambda small: in_kitty(small, own_number()), pixels, columns, rows)


def _at_cursor(draw: Callable[[Pixels], str], pixels: Pixels, columns: int, rows: int) -> str:
    """Pixels and then as many lines as they cover: terminals differ in where pixels leave the
    cursor."""
    width, height = cell()
    small = fitted(pixels, columns * width, rows * height)
    return f"\x1b7{draw(small)}\x1b8" + "\n" * -(-len(small) // height)


def own_number() -> int:
    """The first of sixteen numbers of pictures that no other program on the terminal has."""
    return os.getpid() << 4


def in_kitty(pixels: Pixels, number: int) -> str:
    """Pixels as they are, with the upper left one at the cursor, which stays.  number: of the
    picture, which takes the place of the one with the same number; 0 for none."""
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG", compress_level=1)  # fast: it goes to a neighbour
    data = base64.b64encode(file.getvalue()).decode("ascii")
    chunks = [data[at : at + _CHUNK] for at in range(0, len(data), _CHUNK)]
    which = f",i={number},p=1" if number else ""
    keys = [f"a=T,f=100,C=1{which},", *[""] * (len(chunks) - 1)]
    more = [1] * (len(chunks) - 1) + [0]
    return "".join(
        f"\x1b_G{key}q=2,m={m};{chunk}\x1b\\"
        for key, m, chunk in zip(keys, more, chunks, strict=True)
    )


def without_kitty(number: int) -> str:
    """Deletes the picture with this number."""
    return f"\x1b_Ga=d,d=I,i={number},q=2;\x1b\\"


def in_sixels(pixels: Pixels) -> str:
    """Pixels as they are, but for their colours, with the upper left one at the cursor."""
    from PIL import Image

    step = -(-max(pixels.shape) // _PALETTE_OF)
    some = Image.fromarray(np.ascontiguousarray(pixels[::step, ::step])).quantize(_COLOURS)
    image = Image.fromarray(pixels).quantize(palette=some, dither=Image.Dither.NONE)
    palette = np.array(image.getpalette(), np.int64).reshape(-1, 3)
    index = np.asarray(image)
    percent = np.round(palette * (100.0 / 255.0)).astype(np.int64)
    parts = [f'\x1bPq"1;1;{index.shape[1]};{index.shape[0]}']
    parts += [f"#{k};2;{r};{g};{b}" for k, (r, g, b) in enumerate(percent.tolist())]
    for top in range(0, len(index), 6):
        parts += _band(index[top : top + 6])
    return "".join(parts) + "\x1b\\"


def _band(index: Pixels) -> Iterator[str]:
    """Up to six rows of a palette's numbers: for each colour a line of runs of equal characters,
    63 + the bits of the rows that have it."""
    width = index.shape[1]
    colours, line = np.unique(index, return_inverse=True)
    bits = np.zeros((len(colours), width), np.uint8)
    for row, lines in enumerate(line.reshape(index.shape)):
        bits[lines, np.arange(width)] += np.uint8(1 << row)
    begins = np.ones(bits.shape, bool)
    begins[:, 1:] = bits[:, 1:] != bits[:, :-1]
    at = np.flatnonzero(begins)
    counts, values = np.diff(at, append=bits.size), bits.ravel()[at]
    for begin, count, value in zip(at.tolist(), counts.tolist(), values.tolist(), strict=True):
        if begin % width == 0:
            yield f"{'$' if begin else ''}#{colours[begin // width]}"
        yield f"!{count}{chr(63 + value)}" if count > 3 else chr(63 + value) * count
    yield "-"


def fitted(pixels: Pixels, width: int, height: int) -> Pixels:
    """The picture scaled down, never up, to at most width x height pixels."""
    from PIL import Image

    rows, columns = pixels.shape[:2]
    scale = min(1.0, width / columns, height / rows)
    if scale == 1.0:
        return pixels
    size = max(1, int(columns * scale)), max(1, int(rows * scale))
    return np.asarray(Image.fromarray(pixels).resize(size, Image.Resampling.BOX))


def room() -> tuple[int, int]:
    """Columns and rows for a picture: all but the last two lines.  Obeys COLUMNS and LINES."""
    size = shutil.get_terminal_size()
    return size.columns, max(1, size.lines - 2)


def cell() -> tuple[int, int]:
    """Width and height of a cell in pixels."""
    for shown in (sys.stderr, sys.stdout):
        with suppress(ImportError, OSError, ValueError):
            import fcntl
            import struct
            import termios

            answer = fcntl.ioctl(shown.fileno(), termios.TIOCGWINSZ, bytes(8))
            lines, columns, width, height = struct.unpack("HHHH", answer)
            if lines and columns and width and height:
                return max(1, width // columns), max(1, height // lines)
    return CELL

"""Pictures as text for terminals: half blocks in 24-bit colour, or sixels.

A half block, U+2580, shows two pixels in one cell: the upper one is its foreground, the lower one
its background.  Sixels (DEC VT340, 1987) are bands of six rows in up to 256 colours, which xterm,
mlterm, foot, WezTerm, Windows Terminal and others draw as pixels.
"""

import itertools
import os
import shutil
import sys
import time

import numpy as np
import numpy.typing as npt

Pixels = npt.NDArray[np.uint8]

CELL = (8, 16)
"""Width and height of a cell in pixels, where the terminal does not say."""

_QUERY = b"\x1b[c"
"""Primary device attributes: the answer, such as ESC [ ? 62 ; 4 ; 22 c, has a 4 for sixels."""

_PATIENCE = 0.3
"""Seconds to wait for an answer: terminals give it at once, or never."""

_COLOURS = 256


def half_blocks(pixels: Pixels, columns: int, rows: int) -> str:
    """(height, width, 3) pixels as lines of half blocks, scaled down to fit into the terminal."""
    small = _fitted(pixels, columns, 2 * rows)
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
    from PIL import Image

    width, height = _cell()
    small = _fitted(pixels, columns * width, rows * height)
    image = Image.fromarray(small).quantize(_COLOURS, dither=Image.Dither.FLOYDSTEINBERG)
    palette = np.array(image.getpalette(), np.int64).reshape(-1, 3)
    index = np.asarray(image)
    percent = np.round(palette * (100.0 / 255.0)).astype(np.int64)
    parts = [f'\x1bPq"1;1;{index.shape[1]};{index.shape[0]}']
    parts += [f"#{k};2;{r};{g};{b}" for k, (r, g, b) in enumerate(percent.tolist())]
    for top in range(0, len(index), 6):
        band = index[top : top + 6]
        bits = 1 << np.arange(len(band))[:, None]
        runs = [f"#{k}" + _runs(((band == k) * bits).sum(axis=0)) for k in np.unique(band)]
        parts.append("$".join(runs) + "-")
    return "".join(parts) + "\x1b\\\n"


def _runs(values: npt.NDArray[np.int64]) -> str:
    """Characters 63 + value, equal ones counted."""
    starts = np.concatenate([[0], np.flatnonzero(np.diff(values)) + 1, [len(values)]])
    found = []
    for begin, end in itertools.pairwise(starts.tolist()):
        count, character = end - begin, chr(63 + int(values[begin]))
        found.append(f"!{count}{character}" if count > 3 else character * count)
    return "".join(found)


def _fitted(pixels: Pixels, width: int, height: int) -> Pixels:
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


def _cell() -> tuple[int, int]:
    """Width and height of a cell in pixels."""
    try:
        import fcntl
        import struct
        import termios

        answer = fcntl.ioctl(sys.stdout.fileno(), termios.TIOCGWINSZ, bytes(8))
        lines, columns, width, height = struct.unpack("HHHH", answer)
    except (ImportError, OSError, ValueError):
        return CELL
    if not (lines and columns and width and height):
        return CELL
    return max(1, width // columns), max(1, height // lines)


def draws_sixels() -> bool:
    """Whether the terminal says that it draws sixels.  False where there is no terminal."""
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        return False
    try:
        import termios
        import tty
    except ImportError:  # Windows
        return False
    source = sys.stdin.fileno()
    before = termios.tcgetattr(source)
    try:
        tty.setcbreak(source)
        os.write(sys.stdout.fileno(), _QUERY)
        answer = _answer(source)
    finally:
        termios.tcsetattr(source, termios.TCSADRAIN, before)
    return says_sixels(answer)


def says_sixels(answer: bytes) -> bool:
    """Whether an answer to the query for device attributes names sixels."""
    attributes = answer.rpartition(b"?")[2].rstrip(b"c").split(b";")
    return answer.endswith(b"c") and b"4" in attributes[1:]


def _answer(source: int) -> bytes:
    """What the terminal sends up to a "c", or within `_PATIENCE`."""
    import select

    end, answer = time.monotonic() + _PATIENCE, b""
    while not answer.endswith(b"c"):
        ready, _, _ = select.select([source], [], [], max(0.0, end - time.monotonic()))
        if not ready:
            break
        answer += os.read(source, 64)
    return answer

"""A terminal for tests: a program runs on it, and what it shows are pixels.

It shares nothing with the package: what a program writes is decoded here, half blocks, sixels and
kitty's protocol alike, and painted on one canvas, as are letters (grey cells).
"""

import base64
import fcntl
import io
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
import time

import numpy as np
from PIL import Image

CELL = (10, 22)
"""Width and height of a cell in pixels."""

LETTER, EMPTY = 128, -1
"""What cells are painted with that hold a letter, and those without anything."""

ESCAPE = re.compile(
    rb"\x1b(?:"
    rb"\[(?P<sequence>[?0-9;]*)(?P<final>[A-Za-z])"
    rb"|_(?P<apc>.*?)\x1b\\|P(?P<dcs>.*?)\x1b\\|(?P<short>[78]))",
    re.DOTALL,
)

IN_SESSION = "import fcntl, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0)\n"
"""Begins a program whose terminal this is: Ctrl-C reaches it."""


def decoded_sixels(body):
    """The picture of a sixel string's body, as a terminal paints it: colours in percent."""
    found = re.fullmatch(r'q"1;1;(\d+);(\d+)(.*)', body, re.DOTALL)
    width, height = int(found[1]), int(found[2])
    palette, image = {}, np.full((height + 6, width, 3), EMPTY)
    x = top = colour = 0
    tokens = r"#(\d+);2;(\d+);(\d+);(\d+)|#(\d+)|!(\d+)(.)|(\$)|(-)|(.)"
    for token in re.finditer(tokens, found[3]):
        if token[1]:
            palette[int(token[1])] = [int(token[k]) for k in (2, 3, 4)]
        elif token[5]:
            colour = int(token[5])
        elif token[8]:
            x = 0
        elif token[9]:
            x, top = 0, top + 6
        else:
            count, character = (int(token[6]), token[7]) if token[6] else (1, token[10])
            bits = ord(character) - 63
            assert 0 <= bits < 64
            for k in range(6):
                if bits >> k & 1:
                    image[top + k, x : x + count] = palette[colour]
            x += count
            assert x <= width
    assert (image[height:] == EMPTY).all()
    return image[:height]


class FakeTerminal:
    """columns, rows: of cells;  kitty, sixel: whether it draws these, and says so;  silent: it
    answers nothing."""

    def __init__(self, columns=60, rows=24, kitty=False, sixel=False, silent=False):
        self.columns, self.rows = columns, rows
        self.kitty, self.sixel, self.silent = kitty, sixel, silent
        self.canvas = np.full((rows * CELL[1], columns * CELL[0], 3), EMPTY)
        self.text = [[" "] * columns for _ in range(rows)]
        self.placed = {}  # of kitty: row, column and pixels by number
        self.asked, self.drawn, self.unread = [], [], b""
        self._row = self._column = 0
        self._kept, self._colours, self._chunks = (0, 0), None, ""
        self.master, self.slave = pty.openpty()
        size = struct.pack("HHHH", rows, columns, columns * CELL[0], rows * CELL[1])
        fcntl.ioctl(self.slave, termios.TIOCSWINSZ, size)

    # ---- the program ----------------------------------------------------------------------------

    def run(self, program, on_output=lambda terminal: None, **environment):
        """Run the program, Python's text, until it ends; its exit code.  on_output: called after
        each output."""
        mine = {"TERM": "xterm-256color", "COLORTERM": "truecolor"}
        inherited = {k: v for k, v in os.environ.items() if k not in OF_TERMINALS}
        process = subprocess.Popen(
            [sys.executable, "-c", IN_SESSION + program],
            stdin=self.slave,
            stdout=self.slave,
            stderr=self.slave,
            start_new_session=True,
            env=inherited | mine | environment,
        )
        deadline = time.monotonic() + 120.0
        while True:
            ended = process.poll() is not None
            while select.select([self.master], [], [], 0.02)[0]:
                self.feed(os.read(self.master, 65536))
                on_output(self)
            if ended:
                return process.returncode
            if time.monotonic() > deadline:
                process.kill()
                raise TimeoutError

    def type(self, keys):
        """Keys, or an answer."""
        os.write(self.master, keys)

    def left_in_input(self):
        """What a program would read that runs next; and whether the terminal is in order."""
        mode = termios.tcgetattr(self.slave)
        in_order = bool(mode[3] & termios.ICANON) and bool(mode[3] & termios.ECHO)
        mode[3] &= ~(termios.ICANON | termios.ECHO)
        termios.tcsetattr(self.slave, termios.TCSANOW, mode)
        some = select.select([self.slave], [], [], 0.0)[0]
        return (os.read(self.slave, 4096) if some else b""), in_order

    def close(self):
        os.close(self.master)
        os.close(self.slave)

    # ---- what it shows --------------------------------------------------------------------------

    def lines(self):
        return ["".join(line).rstrip() for line in self.text]

    def visible(self):
        """The canvas (rows, columns, 3) with pictures of kitty's protocol."""
        shown = self.canvas.copy()
        for row, column, pixels in self.placed.values():
            height, width = pixels.shape[:2]
            y, x = row * CELL[1], column * CELL[0]
            shown[y : y + height, x : x + width] = pixels
        return shown

    def picture(self):
        """The smallest rectangle with all that is no letter; None if there is none."""
        shown = self.visible()
        is_picture = ~np.isin(shown, (LETTER, EMPTY)).all(axis=-1)
        rows, columns = (np.flatnonzero(is_picture.any(axis=axis)) for axis in (1, 0))
        if not len(rows):
            return None
        return shown[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]

    # ---- what it reads --------------------------------------------------------------------------

    def feed(self, data):
        data = self.unread + data
        at = 0
        while at < len(data):
            if data[at] == 0x1B:
                found = ESCAPE.match(data, at)
                if found is None:
                    assert len(data) - at < 1 << 22
                    break
                self._escape(found)
                at = found.end()
                continue
            length = 1 + (data[at] >= 0xC0) + (data[at] >= 0xE0) + (data[at] >= 0xF0)
            if at + length > len(data):
                break
            self._character(data[at : at + length].decode())
            at += length
        self.unread = data[at:]

    def _character(self, character):
        if character == "\r":
            self._column = 0
        elif character == "\n":
            self._line()
        else:
            if self._column == self.columns:
                self._column = 0
                self._line()
            y, x = self._row * CELL[1], self._column * CELL[0]
            cell = self.canvas[y : y + CELL[1], x : x + CELL[0]]
            cell[:] = EMPTY if character == " " else LETTER
            if character == "▀" and self._colours:
                cell[: CELL[1] // 2], cell[CELL[1] // 2 :] = self._colours
            self.text[self._row][self._column] = character
            self._column += 1

    def _line(self):
        if self._row + 1 < self.rows:
            self._row += 1
            return
        self.canvas[: -CELL[1]] = self.canvas[CELL[1] :].copy()
        self.canvas[-CELL[1] :] = EMPTY
        self.text = [*self.text[1:], [" "] * self.columns]
        self.placed = {n: (row - 1, *rest) for n, (row, *rest) in self.placed.items()}

    def _escape(self, found):
        if found["short"]:
            if found["short"] == b"7":
                self._kept = self._row, self._column
            else:
                self._row, self._column = self._kept
        elif found["apc"] is not None:
            self._graphics(found["apc"].decode())
        elif found["dcs"] is not None:
            self.drawn.append("sixel")
            if self.sixel:
                # Of 0 to 100 percent, as near as one can.
                self._paint(np.rint(decoded_sixels(found["dcs"].decode()) * 2.55).astype(int))
        else:
            self._sequence(found["sequence"].decode(), found["final"].decode())

    def _sequence(self, given, final):
        number = int(given) if given.isdigit() else 1
        if final == "A":
            self._row = max(0, self._row - number)
        elif final == "C":
            self._column = min(self.columns - 1, self._column + number)
        elif final == "H":
            self._row = self._column = 0
        elif final == "K":
            first = 0 if given == "2" else self._column
            y = self._row * CELL[1]
            self.canvas[y : y + CELL[1], first * CELL[0] :] = EMPTY
            self.text[self._row][first:] = [" "] * (self.columns - first)
        elif final == "J":
            self.canvas[:] = EMPTY
            self.text = [[" "] * self.columns for _ in range(self.rows)]
            self.placed = {}
        elif final == "m":
            found = re.fullmatch(r"38;2;(\d+);(\d+);(\d+);48;2;(\d+);(\d+);(\d+)", given)
            if found or given in ("", "0"):
                numbers = [int(n) for n in found.groups()] if found else None
                self._colours = (numbers[:3], numbers[3:]) if numbers else None
        elif final == "c":
            self.asked.append("attributes")
            if not self.silent:
                self.type(b"\x1b[?62;4;22c" if self.sixel else b"\x1b[?62;22c")
        else:
            assert final in "hl", (given, final)

    def _graphics(self, command):
        keys, _, payload = command.removeprefix("G").partition(";")
        given = dict(key.split("=") for key in keys.split(","))
        if given.get("a") == "q":
            self.asked.append("kitty")
            if self.kitty and not self.silent:
                self.type(b"\x1b_Gi=" + given["i"].encode() + b";OK\x1b\\")
            return
        if not self.kitty:
            return
        assert given["q"] == "2"  # no answers to drawing
        if given.get("a") == "d":
            assert given["d"] == "I"
            self.placed.pop(given["i"], None)
            return
        assert len(payload) <= 4096
        if "a" in given:
            assert (given["a"], given["f"], given["C"]) == ("T", "100", "1")
            self._begun, self._chunks = given, ""
        else:
            assert set(given) == {"q", "m"}
        self._chunks += payload
        if given["m"] == "0":
            self.drawn.append("kitty")
            pixels = Image.open(io.BytesIO(base64.b64decode(self._chunks, validate=True)))
            number = self._begun.get("i", f"nameless {len(self.placed)}")
            self.placed[number] = self._row, self._column, np.asarray(pixels.convert("RGB"), int)

    def _paint(self, pixels):
        height, width = pixels.shape[:2]
        y, x = self._row * CELL[1], self._column * CELL[0]
        assert y + height <= len(self.canvas)
        self.canvas[y : y + height, x : x + width] = pixels


OF_TERMINALS = frozenset(
    {"TMUX", "STY", "TERM_PROGRAM", "NO_COLOR", "REFERENCE_RT_PICTURES", "COLUMNS", "LINES"}
    | {"FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE"}
)
"""Of the environment: what says something about the terminal that the tests run on."""

"""The family of drawings: lines, arrows, dots and letters of one look, written as SVG.

Colour-blind readers can tell the colours apart, and no meaning is in a colour alone: shadow rays
are dashed, what goes wrong has a cross or says so.  Letters are at least 12 pixels high on a
telephone.
"""

import math
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt import Scene, Sphere

FloatArray = npt.NDArray[np.float64]
Place = Sequence[float] | FloatArray
"""x and y; further coordinates are not drawn."""

WIDTH, HEIGHT = 600, 300
"""Of each drawing, in its own units: pixels of a page that has room for them."""

TEXT = 21
"""Height of letters: 12 pixels where a page of 400 pixels leaves 353 to the drawing."""

LINES = {
    "eye": "#0060a8",  # rays from the camera
    "shadow": "#7a3b93",
    "light": "#8f5300",  # what comes from lamps
    "normal": "#00745a",
    "wrong": "#bd3a0f",
    "edge": "#33525a",
    "ink": "#1d2b30",
    "guide": "#77858a",
}
"""Colours of lines, arrow heads, dots, areas and letters."""

STYLE = "".join(
    (
        "path,circle{fill:none;stroke-width:2.5;stroke-linejoin:round}",
        f"text{{font:{TEXT}px Arial,Helvetica,'Liberation Sans',sans-serif;paint-order:stroke;",
        "stroke-width:4px;stroke-linejoin:round}",
        ".b{font-weight:bold}.i{font-family:Georgia,'Liberation Serif',serif;font-style:italic}",
        *(
            f".{kind}{{stroke:{c}}}.{kind}.s,.{kind}.f,text.{kind}{{fill:{c}}}"
            for kind, c in LINES.items()
        ),
        "text[class]{stroke:#fff}path.shadow{stroke-dasharray:9 6}",
        "path.guide{stroke-width:1.5;stroke-dasharray:4 4}.grid{stroke:#c6d0d3;stroke-width:1}",
        ".s{stroke:none}.f{stroke:none;fill-opacity:.22}.o{fill:#fff}",
        ".thin{stroke-width:1.2}.bar{stroke-width:9}",
        ".shape,.glass,.dark,.lamp{stroke:#33525a;stroke-width:2;fill:#e0eaec}",
        ".glass{fill:#d9ecfa}.dark{fill:#9fb0b5}.lamp{fill:#ffd95c;stroke:#8f5300}",
    )
)
"""s: solid, f: an area of the line's colour, o: hollow; b: bold letters, i: those of formulas."""


class View:
    """A part of a drawing that shows a scene, y upwards: its `centre` at `at`, in units of the
    whole drawing, its unit `scale` long.
    """

    def __init__(
        self, marks: list[str], letters: list[str], at: Place, scale: Place, centre: Place = (0, 0)
    ) -> None:
        self.marks, self.letters, self.at = marks, letters, np.asarray(at)
        self.scale, self.centre = np.broadcast_to(np.asarray(scale, float), 2), np.asarray(centre)

    def place(self, p: Place) -> FloatArray:
        """Where a point of the scene is drawn."""
        away = (np.asarray(p, dtype=float)[:2] - self.centre) * self.scale
        return self.at + away * (1, -1)

    def line(self, *points: Place, kind: str, closed: bool = False) -> None:
        self._path(map(self.place, points), kind, closed)

    def _path(self, places: Iterable[Place], kind: str, closed: bool = False) -> None:
        text = "L".join(f"{_short(x)} {_short(y)}" for x, y in places)
        self.marks.append(f'<path class="{kind}" d="M{text}{"Z" * closed}"/>')

    def area(self, *points: Place, kind: str = "shape") -> None:
        self.line(*points, kind=kind, closed=True)

    def box(self, low: Place, high: Place, kind: str = "shape") -> None:
        self.area(low, (high[0], low[1]), high, (low[0], high[1]), kind=kind)

    def arrow(self, p: Place, q: Place, kind: str, head: float = 12.0, short: float = 0.0) -> None:
        """From p to q, where the head ends; `short`: as far before q."""
        start, end = self.place(p), self.place(q)
        along = unit(end - start)
        end = end - short * along
        base, side = end - head * along, 0.42 * head * np.array([-along[1], along[0]])
        self._path((start, base), kind)
        self._path((end, base + side, base - side), f"{kind} s", closed=True)

    def dot(self, p: Place, kind: str = "ink", size: float = 5.0) -> None:
        self.circle(p, size / self.scale[0], f"{kind} s")

    def ring(self, p: Place, kind: str = "ink") -> None:
        """A hollow dot: what does not count, or not yet."""
        self.circle(p, 5.0 / self.scale[0], f"{kind} o")

    def cross(self, p: Place, size: float = 7.0) -> None:
        """What goes wrong is there."""
        x, y = self.place(p)
        for s in (size, -size):
            self._path(((x - size, y - s), (x + size, y + s)), "wrong")

    def circle(self, c: Place, r: float, kind: str = "shape") -> None:
        x, y = self.place(c)
        place = f'cx="{_short(x)}" cy="{_short(y)}" r="{_short(self.scale[0] * r)}"'
        self.marks.append(f'<circle class="{kind}" {place}/>')

    def cells(self, corners: Iterable[Place], colour: str) -> None:
        """Unit squares of one colour, by their lower left corners."""
        side, places = _short(self.scale[0]), (self.place((x, y + 1)) for x, y in corners)
        text = "".join(f"M{_short(x)} {_short(y)}h{side}v{side}h-{side}z" for x, y in places)
        self.marks.append(f'<path style="fill:{colour}" d="{text}"/>')

    def text(
        self, p: Place, words: str, kind: str = "ink", by: Place = (0, 0), anchor: str = "middle"
    ) -> None:
        """Letters at p, moved `by` units of the drawing, y upwards; parts between asterisks are
        formulas."""
        x, y = self.place(p) + np.array([by[0], -by[1]])
        parts = escape(words, quote=False).split("*")
        parts[1::2] = [f'<tspan class="i">{part}</tspan>' for part in parts[1::2]]
        place = f'x="{_short(x)}" y="{_short(y)}" text-anchor="{anchor}"'
        self.letters.append(f'<text class="{kind}" {place}>{"".join(parts)}</text>')

    def texts(self, lines: str) -> None:
        """Labels, one a line: x, y, kind, or kind:anchor, and words."""
        for line in filter(str.strip, lines.splitlines()):
            x, y, look, words = line.split(maxsplit=3)
            kind, _, anchor = look.partition(":")
            self.text((float(x), float(y)), words.strip(), kind, anchor=anchor or "middle")


class Drawing(View):
    """A whole drawing: its own units, y from the lower edge upwards."""

    def __init__(self) -> None:
        super().__init__([], [], (0, HEIGHT), 1)

    def view(self, at: Place, scale: Any = 1, centre: Place = (0, 0)) -> View:
        return View(self.marks, self.letters, self.place(at), scale, centre)

    def heads(self, *words: str, wrong: Iterable[int] = ()) -> None:
        """Heads of columns of equal width, and lines between them; `wrong`: the numbers of those
        that show what goes wrong."""
        step = WIDTH / len(words)
        for k, head in enumerate(words):
            self.text((step * (k + 0.5), 274), head, "wrong b" if k in wrong else "ink b")
            if k:
                self.line((step * k, 8), (step * k, 292), kind="guide")

    def bars(self, x: float, y: float, rows: Iterable[tuple[str, str, Sequence[Place]]]) -> None:
        """Rows of intervals, the first at y, each below the one before: words at x, kind, spans."""
        for k, (words, kind, spans) in enumerate(rows):
            for start, end in spans:
                self.line((start, y - 27 * k), (end, y - 27 * k), kind=f"{kind} bar")
            self.text((x, y - 27 * k), words, kind, (0, -7), "start")

    def svg(self) -> str:
        """The file's text."""
        size = f'width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}"'
        return "\n".join(
            (
                f'<svg xmlns="http://www.w3.org/2000/svg" {size}>',
                f"<style>{STYLE}</style>",
                '<rect width="100%" height="100%" fill="#fff"/>',
                *self.marks,
                *self.letters,
                "</svg>\n",
            )
        )


def _short(value: float) -> str:
    """A tenth of a unit is enough; without a minus before 0."""
    return f"{round(float(value), 1) + 0.0:g}"


def unit(v: Place) -> FloatArray:
    return np.asarray(v, dtype=float) / np.linalg.norm(v)


def polar(degrees: Any, r: Any = 1.0) -> FloatArray:
    """Points of a circle around the origin: (..., 2)."""
    angle = np.radians(degrees)
    return np.stack([r * np.cos(angle), r * np.sin(angle)], axis=-1)


def ball(x: float, y: float, r: float) -> Sphere:
    """Of which a drawing shows the cross-section z = 0."""
    return Sphere(center=(x, y, 0), radius=r)


def crossings(o: Place, d: Place, *shapes: Sphere) -> FloatArray:
    """t of all crossings of a ray with shapes, in order, as the scene says."""
    return Scene(shapes=shapes).crossings([*o, 0.0], [*d, 0.0]).t


class Glass(NamedTuple):
    """A ray at a ball of glass.  p, n: where it enters, and the normal there; mirrored, inside:
    directions; q: where it leaves, in the direction `out`."""

    p: FloatArray
    n: FloatArray
    mirrored: FloatArray
    inside: FloatArray
    q: FloatArray
    out: FloatArray

    @classmethod
    def hit(cls, o: Place, d: Place, glass: Sphere, eta: float = 1.5) -> "Glass":
        c, d = np.array(glass.center[:2]), unit(d)
        p = o + crossings(o, d, glass)[0] * d
        n = unit(p - c)
        inside = refracted(d, n, eta)
        q = p + 2 * (c - p) @ inside * inside  # the chord: its middle is nearest to the centre
        return cls(p, n, d - 2 * (d @ n) * n, inside, q, refracted(inside, unit(c - q), 1 / eta))


def refracted(d: FloatArray, n: FloatArray, eta: float) -> FloatArray:
    """By Snell's law, into what has `eta` times the index; n is against d."""
    c = -d @ n
    return d / eta + (c / eta - math.sqrt(1 - (1 - c * c) / eta**2)) * n

"""Where in the reference the candidate's pixels look: fields of displacements, whose amounts are
fitted.

A warp is a row of WARPS: the sum of a few FIELDS.  To add one, add a row, and its words in
`_told`.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from comparisons.compare.diagnosis.misfit import Misfit, spline
from comparisons.compare.diagnosis.sample import chosen_pixels
from comparisons.results.case import FloatArray

Field = Callable[[FloatArray, FloatArray], tuple[FloatArray | float, FloatArray | float]]
"""Displacements (down, right) in pixels of an amount of 1, of points (y, x) from the middle in
units of its distance from a corner."""

FIELDS: dict[str, Field] = {
    "right": lambda y, x: (0.0, 1.0),
    "down": lambda y, x: (1.0, 0.0),
    "away": lambda y, x: (y, x),
    "along x": lambda y, x: (0.0, x),
    "along y": lambda y, x: (y, 0.0),
    "bent": lambda y, x: (y * (y * y + x * x), x * (y * y + x * x)),
    "turned": lambda y, x: (-x, y),
}

WARPS: dict[str, tuple[tuple[str, ...], bool]] = {
    "shift": (("right", "down"), False),
    "zoom": (("away",), False),
    "zoom in x": (("along x",), False),
    "zoom in y": (("along y",), False),
    "rotation": (("turned",), False),
    "distortion": (("away", "bent"), False),
    "aberration": (("away",), True),
    "shift of a channel": (("right", "down"), True),
}
"""By family: the fields, and whether each channel has amounts of its own."""

STEPS = ((4.0, 2), (2.0, 2), (1.0, 1), (0.0, 3))
"""The width of a blur in pixels, and steps of Gauss and Newton's method: blurred pictures show
displacements that are larger than their details."""

STEP = 0.25
"""Pixels to either side, by whose difference a slope is measured."""

FARTHEST = 3
"""The largest shift that is sought, in pixels along x and y."""

SIZES = (0.5, 0.75, 4.0 / 3.0, 2.0)
"""Zooms from which the search starts, besides 1 and the aspect of the picture and its inverse: a
field of view taken for that of the other axis, or of half of it."""

FARTHER = 0.2
"""Largest change of a distance from the middle that is found from a start: a fifth."""

STILL = 0.05
"""Pixels by which a channel must be moved, and channels differ, to be moved by themselves, and a
corner, to be distorted."""


@dataclass(frozen=True)
class Warp:
    """A fitted one.  amounts (fields, 3): in pixels at the corner, by channel."""

    family: str
    amounts: FloatArray
    order: int

    @property
    def fields(self) -> tuple[str, ...]:
        return WARPS[self.family][0]

    @property
    def parameters(self) -> int:
        moved = np.unique(self.amounts[:, self.amounts.any(axis=0)], axis=1).shape[1]
        return len(self.fields) * max(int(moved), 1)

    def is_shift(self, x: float, y: float) -> bool:
        """Whether it is that by so many pixels to the right and down."""
        by = -np.array([[x], [y]])
        return self.family == "shift" and bool(np.abs(self.amounts - by).max() < STILL)

    def seen(self, misfit: Misfit) -> tuple[FloatArray, FloatArray]:
        """The reference through the warp, and 1 where a pixel shows what is inside of it, 0
        elsewhere."""
        return self.at(misfit, *grid(misfit.reference.shape))

    def at(self, misfit: Misfit, y: FloatArray, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The same at points (y, x) of `grid`, (..., 3)."""
        shape = misfit.reference.shape
        height, width = shape[:2]
        splines = misfit.splines(self.order)
        found, inside = np.empty((*y.shape, 3)), np.empty((*y.shape, 3))
        for k in range(3):
            points = _points(self.fields, self.amounts[:, k], y, x, _middle(shape))
            found[..., k] = _interpolated(splines[k], points, self.order)
            down, right = points
            inside[..., k] = (np.abs(down - 0.5 * (height - 1)) <= 0.5 * height) & (
                np.abs(right - 0.5 * (width - 1)) <= 0.5 * width
            )
        return found, inside

    def slack(self, picture: FloatArray) -> FloatArray:
        """How far values of what is seen through the warp may be off: a step inside a pixel, of
        which t is cut off, is off by t (1 - t) of its height where it is interpolated."""
        slack = np.empty_like(picture)
        for k in range(3):
            values = picture[..., k]
            steps = ndimage.maximum_filter(values, 3) - ndimage.minimum_filter(values, 3)
            points = _points(
                self.fields, self.amounts[:, k], *grid(picture.shape), _middle(picture.shape)
            )
            part = points - np.floor(points)
            slack[..., k] = (part * (1.0 - part)).sum(axis=0) * steps
        return slack

    def told(self, shape: tuple[int, ...]) -> tuple[str, str]:
        """Its name and its evidence."""
        return _told(self.family, self.amounts, _corner(shape))


class Search:
    """The amounts with the least misfit between `base`, seen through a warp, and the candidate.

    base: the reference in the candidate's colours, or the misfit's reference where `colours` gives
    the candidate's for any (points, 3): colours change after positions, and at edges that is not
    the same.
    """

    def __init__(
        self,
        misfit: Misfit,
        base: FloatArray,
        colours: Callable[[FloatArray], FloatArray] | None = None,
    ) -> None:
        shape = base.shape
        self._shape, self._corner = shape, _corner(shape)
        chosen = chosen_pixels(shape).ravel()
        self._grid = grid(shape, chosen)
        self._weights = misfit.weights.reshape(-1, 3)[chosen]
        self._levels = []
        for blur, steps in STEPS if colours is None else STEPS[-1:]:
            wanted: list[FloatArray] = []
            splines: list[FloatArray] = []
            slopes: list[list[FloatArray]] = []
            for k in range(3):
                a, b = misfit.candidate[..., k], base[..., k]
                if blur:
                    a, b = (ndimage.gaussian_filter(p, blur, mode="nearest") for p in (a, b))
                wanted.append(a.ravel()[chosen])
                if colours is None:
                    splines.append(spline(b, 3))
                    slopes.append([np.asarray(slope) for slope in np.gradient(b)])
            splines = splines or misfit.splines(3)
            level = _Level(np.stack(wanted, axis=-1), splines, slopes, 3, colours)
            self._levels.append((steps, level))
        plain = [spline(base[..., k], 1) for k in range(3)]
        self._plain = replace(self._levels[-1][1], splines=plain, slopes=[], order=1)

    def warps(self, rolled: tuple[int, int]) -> Iterator[Warp]:
        """All of them, twice: of a scene that was rendered so, and of a picture that was resampled
        bilinearly.  rolled: the movement to the right and down with the largest correlation."""
        for family in WARPS:
            yield from self.fitted(family, self._start(family, rolled))

    def fitted(self, family: str, start: FloatArray) -> Iterator[Warp]:
        """From a start (fields, 3)."""
        amounts = start
        for steps, level in self._levels:
            for _ in range(steps):
                amounts = self._improved(family, amounts, start, level)
        resampled = amounts
        for _ in range(steps):
            resampled = self._improved(family, resampled, start, self._plain)
        for order, fitted in ((3, amounts), (1, resampled)):
            apart = np.ptp(fitted, axis=1).max() > STILL
            bends = family != "distortion" or np.abs(fitted[1]).max() > STILL
            if bends and (apart or not WARPS[family][1]):
                yield Warp(family, self._still(family, fitted), order)

    def _start(self, family: str, rolled: tuple[int, int]) -> FloatArray:
        fields, _ = WARPS[family]
        starts = [np.zeros((len(fields), 3))]
        if family == "shift" and max(map(abs, rolled)) <= FARTHEST:
            starts.append(-np.tile(np.array(rolled, dtype=float)[:, None], 3))
        if family == "zoom":
            aspect = self._shape[1] / self._shape[0]
            starts += [
                np.full((1, 3), (1.0 / size - 1.0) * self._corner)
                for size in (*SIZES, aspect, 1.0 / aspect)
            ]
        if len(starts) == 1:
            return starts[0]
        return min(starts, key=lambda one: self._squares(family, one, self._levels[0][1]))

    def _squares(self, family: str, amounts: FloatArray, level: "_Level") -> float:
        """The mean over points inside; a warp that sees little of the picture is no start."""
        total, weight = 0.0, 0.0
        for k in range(3):
            points = self._at(family, amounts[:, k])
            inside = self._weights[:, k] * self._is_inside(points)
            rest = level.wanted[:, k] - _interpolated(level.splines[k], points, level.order)
            total += float((inside * rest**2).sum())
            weight += float(inside.sum())
        return total / weight if weight > 0.0 else math.inf

    def _at(self, family: str, amounts: FloatArray) -> FloatArray:
        y, x = self._grid
        return _points(WARPS[family][0], amounts, y, x, _middle(self._shape))

    def _is_inside(self, points: FloatArray) -> FloatArray:
        y, x = points
        height, width = self._shape[:2]
        return np.asarray((y >= 0) & (y <= height - 1) & (x >= 0) & (x <= width - 1), dtype=float)

    def _improved(
        self, family: str, amounts: FloatArray, start: FloatArray, level: "_Level"
    ) -> FloatArray:
        """One step of Gauss and Newton's method."""
        fields, apart = WARPS[family]
        normal, right = np.zeros((3, len(fields), len(fields))), np.zeros((3, len(fields)))
        directions = [FIELDS[name](*self._grid) for name in fields]
        points = np.stack([self._at(family, amounts[:, k]) for k in range(3)], axis=-1)
        rest = level.wanted - level.values(points)
        slopes = level.slopes_at(points)
        for k in range(3):
            columns = np.stack(
                [slopes[0][:, k] * down + slopes[1][:, k] * to for down, to in directions]
            )
            weights = self._weights[:, k] * self._is_inside(points[..., k])
            normal[k] = (columns * weights) @ columns.T
            right[k] = (columns * weights) @ rest[:, k]
        if not apart:
            normal[:], right[:] = normal.sum(axis=0), right.sum(axis=0)
        steps = [np.linalg.lstsq(n, v, rcond=1e-12)[0] for n, v in zip(normal, right, strict=True)]
        most = FARTHEST + 1.0 if "shift" in family else FARTHER * self._corner
        return np.clip(amounts + np.stack(steps, axis=1), start - most, start + most)

    def _still(self, family: str, amounts: FloatArray) -> FloatArray:
        """Channels that do not move do not move a little."""
        if family != "shift of a channel":
            return amounts
        return np.where(np.abs(amounts).max(axis=0) < STILL, 0.0, amounts)


@dataclass(frozen=True)
class _Level:
    """Blurred pictures.  wanted (points, 3): the candidate's values;  splines, slopes (down, right;
    none for order 1): of the base's channels."""

    wanted: FloatArray
    splines: list[FloatArray]
    slopes: list[list[FloatArray]]
    order: int
    colours: Callable[[FloatArray], FloatArray] | None

    def values(self, points: FloatArray) -> FloatArray:
        """(points, 3) at (2, points, 3)."""
        found = [_interpolated(self.splines[k], points[..., k], self.order) for k in range(3)]
        together = np.stack(found, axis=-1)
        return together if self.colours is None else self.colours(together)

    def slopes_at(self, points: FloatArray) -> list[FloatArray]:
        """(points, 3), down and to the right."""
        if self.order == 3 and self.colours is None:
            return [
                np.stack(
                    [_interpolated(self.slopes[k][i], points[..., k], 1) for k in range(3)],
                    axis=-1,
                )
                for i in range(2)
            ]
        # What is interpolated linearly has a slope of its own between any two pixels.
        return [
            (self.values(points + step) - self.values(points - step)) / (2.0 * STEP)
            for step in (np.array([a, b])[:, None, None] for a, b in ((STEP, 0.0), (0.0, STEP)))
        ]


def _corner(shape: tuple[int, ...]) -> float:
    return max(0.5 * math.hypot(shape[0] - 1, shape[1] - 1), 1.0)


def _middle(shape: tuple[int, ...]) -> tuple[float, float, float]:
    return 0.5 * (shape[0] - 1), 0.5 * (shape[1] - 1), _corner(shape)


def grid(
    shape: tuple[int, ...], pixels: npt.NDArray[np.int64] | None = None
) -> tuple[FloatArray, FloatArray]:
    """Rows and columns from the middle, in units of its distance from a corner, of pixels by their
    flat numbers, or of all (height, width)."""
    height, width = shape[:2]
    if pixels is None:
        pixels = np.arange(height * width).reshape(height, width)
    down, right, corner = _middle(shape)
    y, x = (part.astype(np.float64) for part in np.divmod(pixels, width))
    return (y - down) / corner, (x - right) / corner


def _points(
    fields: tuple[str, ...],
    amounts: FloatArray,
    y: FloatArray,
    x: FloatArray,
    middle: tuple[float, float, float],
) -> FloatArray:
    down, right, corner = middle
    at_y, at_x = y * corner + down, x * corner + right
    for name, amount in zip(fields, amounts, strict=True):
        by_y, by_x = FIELDS[name](y, x)
        at_y, at_x = at_y + amount * by_y, at_x + amount * by_x
    return np.stack([at_y, at_x])


def _interpolated(coefficients: FloatArray, points: FloatArray, order: int) -> FloatArray:
    return np.asarray(
        ndimage.map_coordinates(coefficients, points, order=order, mode="nearest", prefilter=False)
    )


CHANNELS = ("red", "green", "blue")


def _told(family: str, amounts: FloatArray, corner: float) -> tuple[str, str]:
    if family == "shift":
        x, y = (-float(v) for v in amounts[:, 0])
        where = f"the candidate is the reference shifted {x:+.3g}, {y:+.3g} pixels (right, down)"
        return _shift_name(x, y), where
    if family == "shift of a channel":
        moved = {
            channel: (-float(v[0]), -float(v[1]))
            for channel, v in zip(CHANNELS, amounts.T, strict=True)
            if v.any()
        }
        told = ", ".join(f"{channel} {x:+.3g}, {y:+.3g}" for channel, (x, y) in moved.items())
        evidence = f"channels are shifted by pixels to the right, and down: {told or 'none'}"
        if len(moved) == 1:
            channel, by = next(iter(moved.items()))
            return f"shift of {channel} by {math.hypot(*by):.2g} pixels", evidence
        return "another shift of each channel", evidence
    if family == "rotation":
        degrees = math.degrees(math.atan(float(amounts[0, 0]) / corner))
        sense = "clockwise" if degrees > 0.0 else "counterclockwise"
        name = f"rotation by {abs(degrees):.2g} degrees"
        return name, f"the candidate's view is rotated {sense} by {abs(degrees):.3g} degrees"
    sizes = 1.0 / (1.0 + amounts[0] / corner)
    size = float(sizes[0])
    if family == "distortion":
        away, barrel = (float(v) / corner for v in amounts[:, 0])
        kind = "barrel" if barrel > 0.0 else "pincushion"
        evidence = (
            f"points are at 1 {away:+.2g} {barrel:+.2g} r² times their distance from the "
            "middle, r being 1 in the corner"
        )
        return f"{kind} distortion of {abs(barrel):.2g}", evidence
    if family == "aberration":
        each = ", ".join(f"{s:.4g}" for s in sizes)
        evidence = f"red, green and blue are {each} times as large, about the picture's middle"
        return "chromatic aberration", evidence
    along = {"zoom in x": "in x alone, ", "zoom in y": "in y alone, "}.get(family, "")
    evidence = (
        f"the candidate's view is {size:.4g} times as large, {along}about the picture's middle"
    )
    return f"zoom {along}of {size:.4g}", evidence


def _shift_name(x: float, y: float) -> str:
    """Of a shift by so many pixels to the right and down."""
    size = math.hypot(x, y)
    for length, name in ((0.5, "half-pixel shift"), (1.0, "shift by one pixel")):
        along_x, along_y = (abs(abs(v) - length) < 0.1 for v in (x, y))
        if (along_x or abs(x) < 0.1) and (along_y or abs(y) < 0.1) and (along_x or along_y):
            where = " and ".join(axis for axis, is_so in (("x", along_x), ("y", along_y)) if is_so)
            return f"{name} in {where}"
    return f"shift by {size:.2g} pixels"

"""Goniometric light: a point whose intensity in each direction is a table that a goniometer has
measured, as files of photometry (IESNA LM-63, .ies) have it.

Directions are those of photometry of type C: the vertical angle gamma from the axis, 0 to 180
degrees, and the horizontal angle C around it, from `c0`, counterclockwise for who looks along the
axis, 0 to 360 degrees.  Between the table's angles the intensity is bilinear in gamma and C, which
is continuous, takes the table's values, and overshoots none of them.
"""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, ClassVar, Literal, NamedTuple, Self

import numpy as np
from pydantic import AfterValidator, Strict, model_validator

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.model import Colour, Description, Direction, Examples, Vector
from reference_rt.core.vec3 import Vec3, dot, length, luminance, row
from reference_rt.jit.kernel import kernel
from reference_rt.lights.light import LightSample, from_position
from reference_rt.lights.lm63 import check_horizontal, check_vertical, read_photometry
from reference_rt.lights.selection.bounds import LightBounds, of_points
from reference_rt.sampling.distribution import cell_of
from reference_rt.textures import NO_TEXTURES, Palette
from reference_rt.textures.parameter import join as joined_columns

_PLACE = {"origin": (0.0, 4.0, 0.5), "target": (0.0, 0.0, 0.0)}
_Numbers = Annotated[tuple[float, ...], Strict(False)]


def _checked(check: Callable[[Sequence[float]], None]) -> AfterValidator:
    def checked(angles: tuple[float, ...]) -> tuple[float, ...]:
        check(angles)
        return angles

    return AfterValidator(checked)


def _not_negative(rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    if not rows or not all(rows):
        raise ValueError("expected rows of numbers, one for each horizontal angle")
    if min(map(min, rows)) < 0.0:
        raise ValueError("has a negative number; expected numbers of at least 0")
    return rows


class Goniometric(Description):
    """A point that emits an intensity which a table gives for each direction, of a file of
    photometry or written here; dark where the table has no vertical angles."""

    EXAMPLES: ClassVar[Examples] = (
        {
            **_PLACE,
            "intensity": (3.0, 2.0, 1.0),
            "vertical_angles": (0.0, 20.0, 90.0),
            "horizontal_angles": (0.0, 60.0, 180.0),
            "values": ((5.0, 4.0, 1.0), (5.0, 3.0, 0.0), (5.0, 6.0, 2.0)),
        },
        {**_PLACE, "file": "lamp.ies", "c0": (1.0, 0.5, 2.0), "intensity": 0.01},
        {**_PLACE, "vertical_angles": (30.0, 120.0), "values": ((8.0, 2.0),)},
    )
    type: Literal["goniometric"] = "goniometric"
    origin: Vector
    """Where it is: [x, y, z] in world coordinates, in scene units."""
    target: Vector
    """A point on the axis, in the direction of the vertical angle 0: [x, y, z] in world
    coordinates, not the origin.  Below a lamp that hangs."""
    c0: Direction = (1.0, 0.0, 0.0)
    """The direction of the horizontal angle 0: [x, y, z] in world coordinates, not along the axis;
    its part across the axis counts."""
    file: str | None = None
    """A file of photometry (.ies, IESNA LM-63, type C), relative to the scene file.  Its candelas,
    with the multiplier and the ballast factors, are taken for W sr^-1."""
    vertical_angles: Annotated[_Numbers, _checked(check_vertical)] | None = None
    """Without a file: angles from the axis in degrees, ascending, from 0 to 180; two or more."""
    horizontal_angles: Annotated[_Numbers, _checked(check_horizontal)] | None = None
    """Angles around the axis in degrees, ascending: 0 alone for a lamp that is the same all around,
    0 to 90, 0 to 180 or 90 to 270 for one that is symmetric, or 0 to 360.  Default: 0 alone."""
    values: Annotated[tuple[_Numbers, ...], Strict(False), AfterValidator(_not_negative)] | None = (
        None
    )
    """Without a file: a row for each horizontal angle of the intensities at all vertical angles, in
    W sr^-1, at least 0."""
    intensity: Colour = (1.0, 1.0, 1.0)
    """A factor of the table's values, linear sRGB."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not 0.0 < math.dist(self.origin, self.target) < math.inf:
            raise ValueError("origin and target give no direction; expected two different points")
        self._frame()
        own = [name for name in ("vertical_angles", "values") if getattr(self, name) is not None]
        if self.file is not None:
            if own or self.horizontal_angles is not None:
                raise ValueError("has a file and a table; expected one of them")
            return self
        if len(own) < 2:
            raise ValueError("has no table; expected a file, or vertical_angles and values")
        assert self.vertical_angles is not None
        k, m = len(self._horizontal), len(self.vertical_angles)
        rows = self.values or ()
        if [len(one) for one in rows] != [m] * k:
            lengths = ", ".join(sorted({str(len(one)) for one in rows}))
            raise ValueError(
                f"values has {len(rows)} rows of {lengths} numbers; expected {k} of {m}, a row for "
                "each horizontal angle"
            )
        return self

    @property
    def _horizontal(self) -> tuple[float, ...]:
        return (0.0,) if self.horizontal_angles is None else self.horizontal_angles

    def _frame(self) -> FloatArray:
        """(3, 3): unit vectors along C = 0 and C = 90 across the axis, and along the axis."""
        axis = np.subtract(self.target, self.origin) / math.dist(self.target, self.origin)
        c90 = np.cross(np.array(self.c0) / max(map(abs, self.c0)), axis)
        size = float(np.linalg.norm(c90))
        if not size > 0.0:
            raise ValueError("c0 is parallel to the light's axis; expected another direction")
        c90 = c90 / size
        return np.stack([np.cross(axis, c90), c90, axis])

    def read(self, folder: Path) -> tuple[Self, str]:
        """The light with the table of its file, and what of the file is left out, in words.  Raises
        ValueError (file, line, what is wrong, what was expected)."""
        if self.file is None:
            return self, ""
        found = read_photometry(folder / self.file)
        # Arrays: tuples of a million numbers take seconds.
        table = {
            "file": None,
            "vertical_angles": found.vertical,
            "horizontal_angles": found.horizontal,
            "values": found.candelas,
        }
        left_out = []
        if any(found.opening):
            size = " x ".join(f"{abs(x):g}" for x in found.opening)
            left_out.append(f"its opening of {size} m: the lamp is a point")
        if found.tilts:
            left_out.append("its factors of tilt: the lamp shines as in the file's own position")
        return self.model_copy(update=table), "; ".join(left_out)

    def tabulate(self, palette: Palette = NO_TEXTURES) -> "Goniometrics":
        """One row, of a light whose file has been read."""
        vertical = np.radians(np.asarray(self.vertical_angles, np.float64))
        horizontal, values = all_around(
            np.asarray(self._horizontal, np.float64), np.asarray(self.values, np.float64)
        )
        horizontal = np.radians(horizontal)
        c0, c90, axis = self._frame()
        shines = np.flatnonzero(values.max(axis=0) > 0.0)
        # Towards a neighbour without light the intensity falls off.
        ends = np.append(shines[:1] - 1, shines[-1:] + 1).clip(0, len(vertical) - 1)
        return Goniometrics(
            position=np.array([self.origin]),
            c0=c0[None],
            c90=c90[None],
            axis=axis[None],
            intensity=np.array([self.intensity]),
            starts=np.zeros((1, 3), np.int64),
            counts=np.array([[len(vertical), len(horizontal)]]),
            vertical=vertical,
            horizontal=horizontal,
            values=values.ravel(),
            flux=np.array([flux(vertical, horizontal, values)]),
            greatest=np.array([values.max()]),
            range=vertical[None, ends] if len(ends) else np.zeros((1, 2)),
        )


def all_around(horizontal: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A table whose horizontal angles (k,), in degrees, are those of a symmetric lamp, with values
    (k, m), written out in full from 0 to 360."""
    first, last = horizontal[0], horizontal[-1]
    if len(horizontal) == 1:
        return np.array([0.0, 360.0]), np.repeat(values, 2, axis=0)
    if first == 90.0:  # the same on both sides of the plane of 90 and 270
        angles = np.concatenate([horizontal, (540.0 - horizontal[::-1])[1:]])
        rows = np.concatenate([values, values[-2::-1]])  # from 90 to 450
        if 360.0 not in angles:
            k = int(np.searchsorted(angles, 360.0))
            t = (360.0 - angles[k - 1]) / (angles[k] - angles[k - 1])
            between = (1.0 - t) * rows[k - 1] + t * rows[k]
            angles, rows = np.insert(angles, k, 360.0), np.insert(rows, k, between, axis=0)
        k = int(np.searchsorted(angles, 360.0))
        angles = np.concatenate([angles[k:] - 360.0, angles[1 : k + 1]])
        return angles, np.concatenate([rows[k:], rows[1 : k + 1]])
    while last < 360.0:  # the same on both sides of the plane of 90, then of that of 180
        horizontal = np.concatenate([horizontal, (2.0 * last - horizontal[::-1])[1:]])
        values = np.concatenate([values, values[-2::-1]])
        last *= 2.0
    return horizontal, values


def flux(vertical: FloatArray, horizontal: FloatArray, values: FloatArray) -> float:
    """The integral over all directions of the bilinear table with angles in radians, vertical (m,)
    and horizontal (k,), and values (k, m).

    Around the axis it is linear, so that the mean of neighbours counts.  Along gamma, of a cell
    with middle m and half the width x, the value at its ends a and b, the integral of the line
    times sin gamma is (a + b) sin m sin x + (b - a) cos m (sin x / x - cos x); the last factor by
    its series, since its terms cancel for small x.
    """
    rings = 0.5 * (values[1:] + values[:-1]).T @ np.diff(horizontal)  # (m,)
    middle, x = 0.5 * (vertical[1:] + vertical[:-1]), 0.5 * np.diff(vertical)
    mean = np.sin(middle) * np.sin(x)
    # sin x / x - cos x is the sum of (-1)^(k + 1) 2k x^2k / (2k + 1)!: at most pi / 2, the twelfth
    # term is 1e-19.
    bend, term = np.zeros_like(x), np.ones_like(x)
    for k in range(1, 13):
        term = term * (x * x / (-2.0 * k * (2.0 * k + 1.0)))
        bend -= 2.0 * k * term
    a, b = rings[:-1], rings[1:]
    return float(np.sum((a + b) * mean + (b - a) * np.cos(middle) * bend))


class Goniometrics(NamedTuple):
    """position (n, 3); unit vectors c0, c90 and axis (n, 3); intensity (n, 3): a factor of the
    table.

    The tables of all lamps, one after another: vertical and horizontal angles in radians, the
    latter from 0 to 2 pi, and values in W sr^-1, of which a row for each horizontal angle.
    starts (n, 3): where those of a lamp begin in each of them;  counts (n, 2): of its angles,
    vertical and horizontal.

    flux (n,): the integral of the table over all directions;  greatest (n,): its largest value;
    range (n, 2): the vertical angles between which it is not 0.
    """

    position: FloatArray
    c0: FloatArray
    c90: FloatArray
    axis: FloatArray
    intensity: FloatArray
    starts: IntArray
    counts: IntArray
    vertical: FloatArray
    horizontal: FloatArray
    values: FloatArray
    flux: FloatArray
    greatest: FloatArray
    range: FloatArray


def join(tables: list[Goniometrics]) -> Goniometrics:
    """Tables of one lamp each as one."""
    sizes = [(len(one.vertical), len(one.horizontal), len(one.values)) for one in tables]
    starts = np.cumsum([(0, 0, 0), *sizes[:-1]], axis=0)
    joined: Goniometrics = joined_columns(tables)
    return joined._replace(starts=np.ascontiguousarray(starts))


@kernel
def value_towards(lamps: Goniometrics, i: int, w: Vec3) -> float:
    """The table's value along `w`, of any length; on the axis itself C is 0.

    Angles are computed from their sine and cosine, which near the axis keeps all digits.
    """
    x, y, z = dot(row(lamps.c0, i), w), dot(row(lamps.c90, i), w), dot(row(lamps.axis, i), w)
    gamma = math.atan2(length(Vec3(x, y, 0.0)), z)
    m, k = lamps.counts[i, 0], lamps.counts[i, 1]
    vertical = lamps.vertical[lamps.starts[i, 0] : lamps.starts[i, 0] + m]
    if not vertical[0] <= gamma <= vertical[m - 1]:
        return 0.0
    around = math.atan2(y, x)
    if around < 0.0:
        around += 2.0 * math.pi
    horizontal = lamps.horizontal[lamps.starts[i, 1] : lamps.starts[i, 1] + k]
    down, across = cell_of(vertical, gamma), cell_of(horizontal, around)
    t = (gamma - vertical[down]) / (vertical[down + 1] - vertical[down])
    s = (around - horizontal[across]) / (horizontal[across + 1] - horizontal[across])
    first = lamps.starts[i, 2] + across * m + down
    values = lamps.values
    one = (1.0 - t) * values[first] + t * values[first + 1]
    other = (1.0 - t) * values[first + m] + t * values[first + m + 1]
    return float((1.0 - s) * one + s * other)


@kernel
def sample(lamps: Goniometrics, i: int, p: Vec3) -> LightSample:
    """The one direction to the light: see `from_position`."""
    position = row(lamps.position, i)
    shining = value_towards(lamps, i, p - position)
    return from_position(position, row(lamps.intensity, i), shining, p)


def power(lamps: Goniometrics, scene_radius: float) -> FloatArray:
    """Luminance of the power (n,)."""
    return np.asarray(luminance(Vec3(*lamps.intensity.T)) * lamps.flux)


def bounds(lamps: Goniometrics) -> LightBounds:
    """The narrower one of the cones around the axis and against it that hold all light."""
    low, high = lamps.range.T
    is_back = math.pi - low < high
    axis = np.where(is_back[:, None], -lamps.axis, lamps.axis)
    intensity = np.asarray(luminance(Vec3(*lamps.intensity.T)) * lamps.greatest)
    return of_points(lamps.position, axis, np.where(is_back, math.pi - low, high), intensity)

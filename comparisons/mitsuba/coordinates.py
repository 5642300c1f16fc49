"""The coordinates u and v of curved surfaces for which meshes stand in, and the derivatives of the
position by them.

On a mesh Mitsuba interpolates uv between vertices, and takes the derivatives as constant on each
triangle.  These here are exact, and defined for points off the surface, too.  They are written for
numbers of NumPy and of Dr.Jit alike: the plugin `comparisons.mitsuba.plugins.exact_coordinates`
uses them, and its error is measured with them.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray

Triple = tuple[Any, Any, Any]

FULL = 2.0 * math.pi


class Maths(NamedTuple):
    """Functions of the numbers in use."""

    sqrt: Callable[[Any], Any]
    atan2: Callable[[Any, Any], Any]
    select: Callable[[Any, Any, Any], Any]

    def turns(self, y: Any, x: Any) -> Any:
        """The angle of (x, y), from 0 to 1."""
        found = self.atan2(y, x) / FULL
        return self.select(found < 0.0, found + 1.0, found)


NUMPY = Maths(np.sqrt, np.arctan2, np.where)


class Round(NamedTuple):
    """A torus around the z axis, or a sphere.  origin (3,): its middle;  major: the radius of the
    circle in the middle of the tube, 0 for a sphere, whose v goes down from pole to pole."""

    origin: tuple[float, float, float]
    major: float
    is_sphere: bool = False

    def numbers(self) -> dict[str, float]:
        """The parameters of the plugin."""
        return {"major": self.major, "is_sphere": float(self.is_sphere)}

    def uv(self, p: Triple, maths: Maths) -> tuple[Any, Any]:
        """u and v at p, which is seen from the origin."""
        x, y, z = p
        rho = maths.sqrt(x * x + y * y)
        if self.is_sphere:
            return maths.turns(y, x), maths.atan2(rho, z) / math.pi
        return maths.turns(y, x), maths.turns(z, rho - self.major)

    def derivatives(self, p: Triple, maths: Maths) -> tuple[Triple, Triple]:
        """dp/du and dp/dv at p; infinite, or not a number, where there are none."""
        x, y, z = p
        rho = maths.sqrt(x * x + y * y)
        turn = -math.pi if self.is_sphere else FULL
        up = turn / rho
        return (-FULL * y, FULL * x, 0.0 * x), (-up * z * x, -up * z * y, turn * (rho - self.major))


class Level(NamedTuple):
    """The surface f = 0 of a quadratic, with u around the z axis and v along it.

    origin (3,): the middle of a box;  half (3,): its half sides, in units of which u is an angle,
    and v goes from 0 to 1;  slopes (9,): the derivatives of f's gradient, row by row;  gradient
    (3,): f's at the origin.
    """

    origin: tuple[float, float, float]
    half: tuple[float, float, float]
    slopes: tuple[float, ...]
    gradient: tuple[float, float, float]

    def numbers(self) -> dict[str, float]:
        """The parameters of the plugin."""
        every = {"half": self.half, "slope": self.slopes, "gradient": self.gradient}
        return {f"{name}_{k}": x for name, values in every.items() for k, x in enumerate(values)}

    def uv(self, p: Triple, maths: Maths) -> tuple[Any, Any]:
        """As `Round.uv`."""
        (x, y, z), (wide, deep, high) = p, self.half
        return maths.turns(y / deep, x / wide), 0.5 * (z / high + 1.0)

    def derivatives(self, p: Triple, maths: Maths) -> tuple[Triple, Triple]:
        """As `Round.derivatives`.

        Along dp/du neither f nor v changes, along dp/dv neither f nor u.  With a and b for the
        gradients of u and v they are b x f' and f' x a, over a . (b x f').  This is 0 where a line
        of constant z runs towards the axis: u does not change along it.
        """
        x, y, z = p
        m, (gx, gy, gz) = self.slopes, self.gradient
        fx = m[0] * x + m[1] * y + m[2] * z + gx
        fy = m[3] * x + m[4] * y + m[5] * z + gy
        fz = m[6] * x + m[7] * y + m[8] * z + gz
        wide, deep, high = self.half
        across, along = x / wide, y / deep
        ax, ay = -along / wide, across / deep  # a, times 2 pi rho²
        volume = ay * fx - ax * fy
        u = FULL * (across * across + along * along) / volume
        v = 2.0 * high / volume
        return (-u * fy, u * fx, 0.0 * u), (-v * fz * ay, v * fz * ax, v * (fx * ay - fy * ax))


Coordinates = Round | Level


def of_quadric(
    matrix: FloatArray, linear: FloatArray, lower: FloatArray, upper: FloatArray
) -> Level:
    """Of the surface x^T M x + l x + c = 0 in a box."""
    middle = 0.5 * (lower + upper)
    half = 0.5 * (upper - lower)
    return Level(
        origin=_three(middle),
        half=_three(half),
        slopes=tuple((2.0 * matrix).ravel().tolist()),
        gradient=_three(linear + 2.0 * matrix @ middle),
    )


def of_cone(radius: float, slope: float, low: float, height: float) -> Level:
    """Of the surface at the distance radius + slope (z - low) from the z axis, whose v is 0 at
    z = low and 1 at low + height."""
    at_zero = radius - slope * low
    matrix = np.diag([1.0, 1.0, -slope * slope])
    linear = np.array([0.0, 0.0, -2.0 * at_zero * slope])
    lower, upper = np.array([-1.0, -1.0, low]), np.array([1.0, 1.0, low + height])
    return of_quadric(matrix, linear, lower, upper)


def _three(values: FloatArray) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def derivatives_at(of: Coordinates, p: FloatArray) -> tuple[FloatArray, FloatArray]:
    """dp/du and dp/dv (n, 3) at points (n, 3), in the shape's own coordinates."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        x, y, z = (p - of.origin).T
        du, dv = of.derivatives((x, y, z), NUMPY)
    return np.column_stack(du), np.column_stack(dv)

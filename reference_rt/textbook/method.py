"""`Method`, one textbook method with its name and source, and the checks of its arrays."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import Vec3, row
from reference_rt.jit.kernel import kernel

FloatArray = npt.NDArray[np.float64]

Run = Callable[[Any, FloatArray, FloatArray, FloatArray], None]
"""`Method.run`."""


@dataclass(frozen=True)
class Method:
    """A method that intersects one shape, solid or scene with n rays.

    name: "family.method";  row: the textbook row that it is from;  summary: one line;  source:
    author, year;  parameters: the NamedTuple of the family;  prepare(parameters): checks them and
    returns the first argument of `run`;  run(prepared, origins, directions, t): writes t (n,).
    whole: whether it takes all rays of a picture at once, in their order.
    To measure time, call `prepare` once and `run` many times.
    """

    name: str
    row: str
    summary: str
    source: str
    parameters: type
    prepare: Callable[[Any], Any]
    run: Run
    whole: bool = False

    def intersect(
        self, parameters: Any, origins: npt.ArrayLike, directions: npt.ArrayLike
    ) -> FloatArray:
        """The smallest t > 0 (n,) at which each ray hits the surface, inf for a miss.

        Origins and directions are (n, 3); directions may have any length: t is in units of |d|.
        """
        if not isinstance(parameters, self.parameters):
            raise ValueError(
                f"{self.name} takes {self.parameters.__name__}, got {type(parameters).__name__}"
            )
        o, d = rays(origins, directions)
        t = np.empty(len(o))
        with np.errstate(all="ignore"):
            self.run(self.prepare(parameters), o, d, t)
        return t


def family(
    name: str, row: str, parameters: type, prepare: Callable[[Any], Any]
) -> Callable[[str, str, str, Run], Method]:
    """What the methods of a family share: a function of a method's name, summary, source and `run`
    that makes the `Method`."""

    def method(of_method: str, summary: str, source: str, run: Run) -> Method:
        return Method(f"{name}.{of_method}", row, summary, source, parameters, prepare, run)

    return method


def rays(origins: npt.ArrayLike, directions: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Both as new float64 arrays (n, 3), checked."""
    o, d = (np.array(a, dtype=np.float64, order="C") for a in (origins, directions))
    if o.shape != d.shape or o.ndim != 2 or o.shape[1] != 3:
        raise ValueError(f"expected two (n, 3) arrays, got {o.shape} and {d.shape}")
    if not (np.isfinite(o).all() and np.isfinite(d).all() and d.any(axis=1).all()):
        raise ValueError("a ray is not finite or has no direction; expected finite numbers, d != 0")
    return o, d


def points(value: npt.ArrayLike, name: str) -> FloatArray:
    """`value` as a float64 array (n, 3), checked."""
    array = np.asarray(value, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 3 or not np.isfinite(array).all():
        raise ValueError(f"{name}: expected points of three finite numbers, got {value!r}")
    return array


def vector(value: npt.ArrayLike, name: str) -> Vec3:
    """`value` as a Vec3 of np.float64, which divides by zero as in IEEE 754 in plain Python too."""
    array = np.asarray(value, dtype=np.float64)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise ValueError(f"{name}: expected three finite numbers, got {value!r}")
    return Vec3(array[0], array[1], array[2])


@kernel
def ray_of(origins: FloatArray, directions: FloatArray, i: int) -> Ray:
    """Ray i, with t_max = inf."""
    return Ray(row(origins, i), row(directions, i), math.inf)

"""All crossings of rays with one CSG solid, with error bounds: for tests of the solid's laws."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from reference_rt.accel.geometry import Geometry
from reference_rt.accel.next_crossing import crossings_of_solid
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import row
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.kernel import entry_kernel
from reference_rt.rendering.query.linked import link_to_geometry
from reference_rt.rendering.query.rays import checked_rays

SOLIDS = ("crossings_of_solid",)
"""The operation on the geometry."""


@dataclass(frozen=True)
class SolidCrossings:
    """The crossings of n rays with the surface of a solid, in order, at all t > 0.

    t (n, k): inf where there are fewer than k;  width (n, k): error bound of t: crossings closer
    than the sum of their widths are merged, so that material or a gap between them is not reported;
    part (n, k): number of the operand whose surface is crossed;  count (n,): number of crossings.
    """

    t: FloatArray
    width: FloatArray
    part: IntArray
    count: IntArray


@entry_kernel
def crossings_kernel(
    geometry: Geometry,
    solid: int,
    o: FloatArray,
    d: FloatArray,
    t: FloatArray,
    widths: FloatArray,
    part: IntArray,
    count: IntArray,
) -> None:
    for i in range(len(o)):
        ray = Ray(row(o, i), row(d, i), math.inf)
        count[i] = crossings_of_solid(geometry, solid, ray, t[i], widths[i], part[i])


def crossings(
    scene: SceneTables,
    solid: int,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    most: int = 64,
) -> SolidCrossings:
    """All crossings of each ray with solid number `solid`, in the scene's order of solids.  At most
    `most` per ray are returned; `count` counts all."""
    solids = scene.geometry.solids
    if solids is None or not 0 <= solid < len(solids.first):
        known = 0 if solids is None else len(solids.first)
        raise ValueError(f"there is no solid {solid}; expected one of the scene's {known}")
    o, d = checked_rays(origins, directions)
    t, widths = np.full((2, len(o), most), math.inf)
    part = np.full((len(o), most), -1)
    count = np.zeros(len(o), np.int64)
    crossed = link_to_geometry(scene, *SOLIDS)
    with np.errstate(all="ignore"):
        crossings_kernel(crossed.tables, solid, o, d, t, widths, part, count)
    return SolidCrossings(t, widths, part, count)

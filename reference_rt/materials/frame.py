"""The shading frame whose x axis follows the texture coordinate u."""

from reference_rt.core.ray import UNIT_ROUNDOFF
from reference_rt.core.vec3 import Frame, Vec3, cross, dot, frame_from_normal, max_abs, normalize
from reference_rt.jit.kernel import kernel
from reference_rt.shapes.shape import Tangents

_NOISE = 64.0 * UNIT_ROUNDOFF
"""Orthogonalisation takes the part along the unit normal off a vector of size 1.  A remainder
shorter than this is rounding noise, of some ten roundings of numbers up to 1.  A longer one is
orthogonal to the last bits when that is done twice ("twice is enough": Parlett 1980, "The Symmetric
Eigenvalue Problem", 6.9)."""


@kernel
def frame_along(n: Vec3, direction: Vec3) -> Frame:
    """A right-handed basis around a unit normal, its `s` as far along `direction` (of any length)
    as it can be; any where that is parallel to n, or zero."""
    size = max_abs(direction)
    if not size > 0.0:
        return frame_from_normal(n)
    s = direction / size
    s = s - n * dot(n, s)
    if max_abs(s) <= _NOISE:
        return frame_from_normal(n)
    s = normalize(s)
    s = normalize(s - n * dot(n, s))
    return Frame(s, cross(n, s), n)


@kernel
def oriented_frame(ns: Vec3, tangents: Tangents) -> Frame:
    """The basis around a shading normal with `s` along dp/du, and t = n x s (as Mitsuba's)."""
    return frame_along(ns, tangents.dpdu)

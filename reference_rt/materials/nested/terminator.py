"""What bump and normal maps may do about tilted normals that geometry contradicts.

A tilted normal may face away from the viewer, and at grazing angles light that the surface itself
receives ends at a hard line.  Both are options, off by default; Mitsuba has both on.
"""

import math

from reference_rt.core.vec3 import Vec3, dot
from reference_rt.jit.kernel import kernel

_LARGEST = 1.0
"""The largest alpha² of the microfacets."""


@kernel
def facing(n: Vec3, wo: Vec3) -> Vec3:
    """The tilted normal n; where it faces away from wo as the surface does not, turned by half a
    turn about the surface's own normal, (0, 0, 1)."""
    if wo.z * dot(wo, n) <= 0.0:
        return Vec3(-n.x, -n.y, n.z)
    return n


@kernel
def shadowing_alpha2(n: Vec3) -> float:
    """alpha² of the GGX microfacets whose masking takes the place of the hard line: an eighth of
    tan² of the tilt, at most 1 (Estevez, Lecocq & Stein 2019, "A Microfacet-Based Shadowing
    Function to Solve the Bump Terminator Problem", Ray Tracing Gems, chapter 12)."""
    across, along = n.x * n.x + n.y * n.y, n.z * n.z
    if 0.125 * across >= _LARGEST * along:
        return _LARGEST
    return 0.125 * across / along


@kernel
def shadowing(alpha2: float, wi: Vec3) -> float:
    """Smith's masking of light from `wi`, in the frame before the tilt: 2 / (1 + sqrt(1 + alpha²
    tan²)), multiplied out so that it is finite at grazing angles."""
    z = abs(wi.z)
    across = wi.x * wi.x + wi.y * wi.y
    root = math.sqrt(z * z + alpha2 * across)
    if not root > 0.0:
        return 1.0 if alpha2 == 0.0 else 0.0
    return 2.0 * z / (z + root)

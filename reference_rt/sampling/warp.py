"""Warps: maps from the unit square to disks and directions, each with its density; the functions of
angles that they need, in turns."""

import math

from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel

# Coefficients of sin(pi/2 r) / r and cos(pi/2 r) in r²: (-1)^k (pi/2)^(2k+1) / (2k+1)! and
# (-1)^k (pi/2)^(2k) / (2k)!. For |r| <= 1/2 the first omitted terms are below 5e-17.
_SIN = [(-1) ** k * (math.pi / 2) ** (2 * k + 1) / math.factorial(2 * k + 1) for k in range(8)]
_COS = [(-1) ** k * (math.pi / 2) ** (2 * k) / math.factorial(2 * k) for k in range(9)]
_S0, _S1, _S2, _S3, _S4, _S5, _S6, _S7 = _SIN
_C0, _C1, _C2, _C3, _C4, _C5, _C6, _C7, _C8 = _COS

# Coefficients of atan(r) / (2 pi r) in r²: the polynomial that has its values at the 12 Chebyshev
# nodes of [0, tan²(pi/8)].  Its relative error is below 7e-17, found with 60 digits.
_A0, _A1, _A2 = 0.15915494309189535, -0.05305164769729811, 0.03183098861828499
_A3, _A4, _A5 = -0.022736420431411483, 0.017683881982953932, -0.014468611642996702
_A6, _A7, _A8 = 0.01224227036878328, -0.010604417164727426, 0.009305595808396688
_A9, _A10, _A11 = -0.008013614365614182, 0.006042358173997341, -0.002833816740084345
_TAN_PI_8 = math.sqrt(2.0) - 1.0

_SQRT_HALF = math.sqrt(0.5)


@kernel
def on_circle(turns: float) -> tuple[float, float]:
    """(cos, sin) of 2 pi `turns`, for 0 <= turns < 1, each to within 4 u (measured: 2 u).

    Quarter turns are split off exactly, whereas cos(2 * pi * turns) would round the angle first;
    and the Cornell box renders in a tenth less time than with the library's two calls (measured).
    """
    quarters = math.floor(4.0 * turns + 0.5)
    r = 4.0 * turns - quarters
    z = r * r
    z2 = z * z
    z4 = z2 * z2
    # Estrin's scheme: a third of the latency of Horner's.
    s = (_S0 + _S1 * z) + (_S2 + _S3 * z) * z2 + ((_S4 + _S5 * z) + (_S6 + _S7 * z) * z2) * z4
    c = (_C0 + _C1 * z) + (_C2 + _C3 * z) * z2 + ((_C4 + _C5 * z) + (_C6 + _C7 * z) * z2) * z4
    sine, cosine = s * r, c + _C8 * (z4 * z4)
    quadrant = int(quarters) & 3
    if quadrant & 1:
        sine, cosine = cosine, -sine
    if quadrant & 2:
        sine, cosine = -sine, -cosine
    return cosine, sine


@kernel
def turns(y: float, x: float) -> float:
    """atan2(y, x) / 2 pi, from -1/2 to 1/2, to within 8 u of itself (measured: 6.4 u); 0 at the
    origin.  |x| + |y| must be finite.

    It takes 0.4 of the time of the library's function (measured).  An angle above pi/8 is
    measured from pi/4, so that one division leaves the tangent of at most pi/8.
    """
    a, b = abs(y), abs(x)
    low, high = min(a, b), max(a, b)
    if high == 0.0:
        return 0.0
    from_diagonal = low > high * _TAN_PI_8
    tangent = (low - high if from_diagonal else low) / (low + high if from_diagonal else high)
    z = tangent * tangent
    z2 = z * z
    z4 = z2 * z2
    series = (_A0 + _A1 * z) + (_A2 + _A3 * z) * z2
    series += ((_A4 + _A5 * z) + (_A6 + _A7 * z) * z2) * z4
    series += ((_A8 + _A9 * z) + (_A10 + _A11 * z) * z2) * (z4 * z4)
    angle = (0.125 if from_diagonal else 0.0) + tangent * series
    if a > b:
        angle = 0.25 - angle
    if x < 0.0:
        angle = 0.5 - angle
    return math.copysign(angle, y)


@kernel
def around(y: float, x: float) -> float:
    """`turns` from 0 to 1."""
    angle = turns(y, x)
    return angle if angle >= 0.0 else angle + 1.0


@kernel
def concentric_disk(u0: float, u1: float) -> tuple[float, float]:
    """A uniform point on the unit disk: concentric squares become circles (Shirley & Chiu 1997, "A
    Low Distortion Map Between Disk and Square").  (1/2, 1/2) maps to the centre exactly.
    """
    x, y = 2.0 * u0 - 1.0, 2.0 * u1 - 1.0
    a, b = abs(x), abs(y)
    r = max(a, b)
    if r == 0.0:
        return 0.0, 0.0
    cosine, sine = on_circle(0.125 * (min(a, b) / r))  # an eighth of a turn at most
    if a < b:
        cosine, sine = sine, cosine
    return math.copysign(r * cosine, x), math.copysign(r * sine, y)


@kernel
def cosine_hemisphere(u0: float, u1: float) -> Vec3:
    """A direction with density cos theta / pi: the disk lifted to the hemisphere (Malley)."""
    r = math.sqrt(u0)
    cos_phi, sin_phi = on_circle(u1)
    return Vec3(r * cos_phi, r * sin_phi, math.sqrt(1.0 - u0))


@kernel
def uniform_sphere(u0: float, u1: float) -> Vec3:
    """A direction with density 1 / (4 pi) (Archimedes: height is uniform)."""
    r = 2.0 * math.sqrt(u0 * (1.0 - u0))
    cos_phi, sin_phi = on_circle(u1)
    return Vec3(r * cos_phi, r * sin_phi, 1.0 - 2.0 * u0)


@kernel
def about_normal(u: float) -> float:
    """The u-quantile of the normal distribution with mean 0 and variance 1/2, for 1e-18 <= u < 1,
    to 2e-7 (Wichura 1988, "The Percentage Points of the Normal Distribution", AS 241's PPND7)."""
    off = u - 0.5
    if abs(off) <= 0.425:
        r = 0.180625 - off * off
        above = ((59.109374720 * r + 159.29113202) * r + 50.434271938) * r + 3.3871327179
        below = ((67.187563600 * r + 78.757757664) * r + 17.895169469) * r + 1.0
        return _SQRT_HALF * off * above / below
    r = math.sqrt(-math.log(min(u, 1.0 - u)))
    if r <= 5.0:
        r -= 1.6
        above = ((0.17023821103 * r + 1.3067284816) * r + 2.7568153900) * r + 1.4234372777
        below = (0.12021132975 * r + 0.73700164250) * r + 1.0
    else:
        r -= 5.0
        above = ((0.017337203997 * r + 0.42868294337) * r + 3.0812263860) * r + 6.6579051150
        below = (0.012258202635 * r + 0.24197894225) * r + 1.0
    return math.copysign(_SQRT_HALF * above / below, off)

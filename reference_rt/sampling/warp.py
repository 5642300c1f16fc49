"""Warps: maps from the unit square to disks and directions, each with its density; the functions of
angles that they need, in turns."""

import math
from typing import Any

from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel
from reference_rt.jit.simd import TINY, larger, select, smaller, whole_part, with_sign

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

# The coefficients of `about_normal`: above the line eight, below it seven.
_MIDDLE = (
    *(3.3871328727963666080, 133.14166789178437745, 1971.5909503065514427, 13731.693765509461125),
    *(45921.953931549871457, 67265.770927008700853, 33430.575583588128105, 2509.0809287301226727),
    *(42.313330701600911252, 687.18700749205790830, 5394.1960214247511077, 21213.794301586595867),
    *(39307.895800092710610, 28729.085735721942674, 5226.4952788528545610),
)
_NEAR = (
    *(1.42343711074968357734, 4.63033784615654529590, 5.76949722146069140550),
    *(3.64784832476320460504, 1.27045825245236838258, 0.241780725177450611770),
    *(0.0227238449892691845833, 7.74545014278341407640e-4),
    *(2.05319162663775882187, 1.67638483018380384940, 0.689767334985100004550),
    *(0.148103976427480074590, 0.0151986665636164571966, 5.47593808499534494600e-4),
    1.05075007164441684324e-9,
)
_FAR = (
    *(6.65790464350110377720, 5.46378491116411436990, 1.78482653991729133580),
    *(0.296560571828504891230, 0.0265321895265761230930, 1.24266094738807843860e-3),
    *(2.71155556874348757815e-5, 2.01033439929228813265e-7),
    *(0.599832206555887937690, 0.136929880922735805310, 0.0148753612908506148525),
    *(7.86869131145613259100e-4, 1.84631831751005468180e-5, 1.42151175831644588870e-7),
    2.04426310338993978564e-15,
)


@kernel
def on_circle(turns: Any) -> tuple[Any, Any]:
    """(cos, sin) of 2 pi `turns`, for 0 <= turns < 1, each to within 4 u (measured: 2 u); a generic
    function (`jit.simd`).

    Quarter turns are split off exactly, whereas cos(2 * pi * turns) would round the angle first;
    and the Cornell box renders in a tenth less time than with the library's two calls (measured).
    """
    quarters = whole_part(4.0 * turns + 0.5)
    r = 4.0 * turns - quarters
    z = r * r
    z2 = z * z
    z4 = z2 * z2
    # Estrin's scheme: a third of the latency of Horner's.
    s = (_S0 + _S1 * z) + (_S2 + _S3 * z) * z2 + ((_S4 + _S5 * z) + (_S6 + _S7 * z) * z2) * z4
    c = (_C0 + _C1 * z) + (_C2 + _C3 * z) * z2 + ((_C4 + _C5 * z) + (_C6 + _C7 * z) * z2) * z4
    sine, cosine = s * r, c + _C8 * (z4 * z4)
    is_odd, is_beyond = abs(abs(quarters - 2.0) - 1.0) < 0.5, abs(quarters - 2.5) < 1.0
    sine, cosine = select(is_odd, cosine, sine), select(is_odd, -sine, cosine)
    return select(is_beyond, -cosine, cosine), select(is_beyond, -sine, sine)


@kernel
def turns(y: Any, x: Any) -> Any:
    """atan2(y, x) / 2 pi, from -1/2 to 1/2, to within 8 u of itself (measured: 6.4 u); 0 at the
    origin; a generic function (`jit.simd`).  |x| + |y| must be finite, and 0 or a normal number.

    It takes 0.4 of the time of the library's function (measured).  An angle above pi/8 is
    measured from pi/4, so that one division leaves the tangent of at most pi/8.
    """
    a, b = abs(y), abs(x)
    low, high = smaller(a, b), larger(larger(a, b), TINY)
    from_diagonal = low > high * _TAN_PI_8
    tangent = select(from_diagonal, low - high, low) / select(from_diagonal, low + high, high)
    z = tangent * tangent
    z2 = z * z
    z4 = z2 * z2
    series = (_A0 + _A1 * z) + (_A2 + _A3 * z) * z2
    series += ((_A4 + _A5 * z) + (_A6 + _A7 * z) * z2) * z4
    series += ((_A8 + _A9 * z) + (_A10 + _A11 * z) * z2) * (z4 * z4)
    angle = select(from_diagonal, 0.125, 0.0) + tangent * series
    angle = select(a > b, 0.25 - angle, angle)
    return with_sign(select(x < 0.0, 0.5 - angle, angle), y)


@kernel
def around(y: float, x: float) -> float:
    """`turns` from 0 to 1."""
    angle: float = turns(y, x)
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
    to within 8 u of itself (Wichura 1988, "The Percentage Points of the Normal Distribution", AS
    241's PPND16, whose error is 1e-16; measured: 6 u)."""
    off = u - 0.5
    if abs(off) <= 0.425:
        r = 0.180625 - off * off
        return _SQRT_HALF * off * _ratio(_MIDDLE, r)
    r = math.sqrt(-math.log(min(u, 1.0 - u)))
    size = _ratio(_NEAR, r - 1.6) if r <= 5.0 else _ratio(_FAR, r - 5.0)
    return math.copysign(_SQRT_HALF * size, off)


@kernel
def _ratio(k: tuple[float, ...], r: float) -> float:
    """The quotient of two polynomials of degree 7, of coefficients from the constant on; the second
    one's constant is 1.  By Estrin's scheme."""
    r2 = r * r
    r4 = r2 * r2
    above = (k[0] + k[1] * r) + (k[2] + k[3] * r) * r2
    above += ((k[4] + k[5] * r) + (k[6] + k[7] * r) * r2) * r4
    below = (1.0 + k[8] * r) + (k[9] + k[10] * r) * r2
    below += ((k[11] + k[12] * r) + (k[13] + k[14] * r) * r2) * r4
    return above / below

"""Vectors of fractions: floats are rationals, so that what is computed from them is exact."""

import math
from fractions import Fraction as Q


def q(v):
    return [Q(float(x)) for x in v]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def sub(a, b):
    return [x - y for x, y in zip(a, b, strict=True)]


def cross(a, b):
    (ax, ay, az), (bx, by, bz) = a, b
    return [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]


def root(x):
    """sqrt of a rational to 200 binary places."""
    return Q(math.isqrt((x.numerator << 400) // x.denominator), 1 << 200)

"""What the tests of methods share: an example of each family, and rational arithmetic.

Floats are rationals, so the right answer is exact.  u = 2**-53 is the unit roundoff.
"""

import itertools
import math
from fractions import Fraction as Q

import reference_rt as rt
from reference_rt import textbook
from reference_rt.core import transform

UNIT_SPHERE = textbook.SphereParameters((0, 0, 0), 1)
CUBE = textbook.BoxParameters((-1, -1, -1), (1, 1, 1))
TRIANGLE = textbook.TriangleParameters((0, 0, 0), (4, 0, 0), (0, 4, 0))
L_SHAPE = textbook.PolygonParameters(
    [[(0, 0, 0), (4, 0, 0), (4, 2, 0), (2, 2, 0), (2, 4, 0), (0, 4, 0)]]
)
ROUNDED = rt.Sphere(radius=1.2) & rt.Box() - rt.Sphere(radius=0.9)
SCENE = rt.Scene(
    shapes=(
        rt.Sphere(center=(-1, 0, 0.5), radius=0.7),
        rt.Rectangle(transform=(transform.Translate(translate=(0.0, 0.0, -1.0)),)),
        rt.Triangle(v0=(-1, 1, -1), v1=(1, 1, 0), v2=(0, 1, 1)),
        rt.Box(transform=(transform.Scale(scale=0.3),)),
    )
)
EXAMPLES = {
    "sphere": UNIT_SPHERE,
    "box": CUBE,
    "triangle": TRIANGLE,
    "polygon": L_SHAPE,
    "csg": textbook.CsgParameters(ROUNDED),
    "hierarchy": textbook.SceneParameters(SCENE),
}
DIRECTIONS = [d for d in itertools.product((-1.0, -0.0, 0.0, 1.0), repeat=3) if any(d)]


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


def first(*candidates):
    """The smallest t > 0, inf if there is none."""
    return min((t for t in candidates if t > 0), default=math.inf)


def off(t, exact):
    """|t - exact| of two finite numbers, 0 for two misses."""
    assert (t == math.inf) == (exact == math.inf), (t, float(exact))
    return 0.0 if exact == math.inf else float(abs(Q(t) - exact))


def mixed_lengths(rng, d):
    return d * 10.0 ** rng.uniform(-2, 2, (len(d), 1))

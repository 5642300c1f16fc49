"""Helpers for tests of the textbook's methods: an example of each family, and errors of t."""

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
PICTURE = rt.Scene(
    camera=rt.Perspective(eye=(0.5, 0.3, 3)),
    film=rt.Film(width=8, height=6),
    shapes=(rt.Triangle(v0=(-1, 1, -1), v1=(1, 1, 0), v2=(0, -1, 1)),),
)
EXAMPLES = {
    "sphere": UNIT_SPHERE,
    "box": CUBE,
    "triangle": TRIANGLE,
    "polygon": L_SHAPE,
    "csg": textbook.CsgParameters(ROUNDED),
    "hierarchy": textbook.SceneParameters(SCENE),
    "picture": textbook.SceneParameters(PICTURE),
}
DIRECTIONS = [d for d in itertools.product((-1.0, -0.0, 0.0, 1.0), repeat=3) if any(d)]


def first(*candidates):
    """The smallest t > 0, inf if there is none."""
    return min((t for t in candidates if t > 0), default=math.inf)


def off(t, exact):
    """|t - exact| of two finite numbers, 0 for two misses."""
    assert (t == math.inf) == (exact == math.inf), (t, float(exact))
    return 0.0 if exact == math.inf else float(abs(Q(t) - exact))


def mixed_lengths(rng, d):
    return d * 10.0 ** rng.uniform(-2, 2, (len(d), 1))

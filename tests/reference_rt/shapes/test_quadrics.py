"""What is special about quadrics: bounds, coordinates, where f is flat, descriptions.

What they have in common with other shapes is in `test_shapes_exact`."""

import math
import re
from fractions import Fraction

import numpy as np
import pytest
from builders import U, unit_vectors
from placed_shapes import Placed, anywhere, put
from quadric_kinds import KINDS, quadric_of

import reference_rt as rt
from reference_rt.core import transform
from reference_rt.util.errors import SceneError

# ---- bounds, coordinates, where f is flat -------------------------------------------------------


def test_bounds_of_an_ellipsoid_are_tight():
    placed = Placed(put(rt.Sphere(radius=0.7), np.diag([1.0, 2.0, 3.0])))
    assert np.allclose([placed.upper, -placed.lower], [0.7, 1.4, 2.1], rtol=1e-14)


@pytest.mark.parametrize("name", KINDS)
def test_hits_are_where_the_description_says(name):
    """f is 0 on face 0; the other faces are those of the box, by number."""
    rng = np.random.default_rng(18)
    for shape in KINDS[name]:
        if shape.type != "quadric":
            continue
        placed = Placed(anywhere(rng, shape))
        o, d = placed.rays(rng, 400, (-1.0, 1.0))
        found = placed.probe(o, d)
        hit = np.isfinite(found.t)
        assert hit.sum() > 20
        m = transform.affine(placed.shape.transform)
        q = (found.p[hit] - m[:, 3]) @ np.linalg.inv(m[:, :3]).T
        x, y, z = q.T
        f = shape.coefficients @ np.array(
            [x * x, y * y, z * z, x * y, y * z, x * z, x, y, z, np.ones(len(x))]
        )
        face = found.face[hit].astype(int)
        assert np.abs(f[face == 0]).max(initial=0.0) < 1e-9
        ends, cap = np.array([*shape.lower, *shape.upper]), face > 0
        assert np.allclose(q[cap, (face[cap] - 1) % 3], ends[face[cap] - 1], atol=1e-9)
        assert (f[cap] <= 1e-9).all()
        assert (
            np.abs(2.0 * q - np.add(shape.lower, shape.upper))
            <= np.subtract(shape.upper, shape.lower) + 1e-9
        ).all()


def test_coordinates():
    """(phi / 2 pi, z) of the box on the surface, two of its coordinates on a cap."""
    shape = quadric_of(
        0, 0, 1, 0, 0, 0, 0, 0, 0, -4, capped=True, lower=(0, 0, -1), upper=(4, 8, 3)
    )
    o, d = [[3, 6, 9], [3, 6, -9], [9, 6, 1]], [[0, 0, -1], [0, 0, 1], [-1, 0, 0]]
    found = Placed(shape).probe(o, d)
    assert found.face.tolist() == [0, 3, 4]
    assert np.allclose(found.t, [7, 8, 5])
    assert np.allclose([found.u, found.v], [[0.125, 0.75, 0.75], [0.75, 0.75, 0.5]])


def test_leaving_where_two_planes_meet():
    """Next to where f is flat, a surface's error has to grow: |f| does not tell otherwise."""
    rng = np.random.default_rng(16)
    n = 1000
    for capped in (False, True):
        # (x - 1/2)² - (y - 1/4)², off the middle.
        shape = quadric_of(1, -1, 0, 0, 0, 0, -1, 0.5, 0, 0.1875, capped=capped)
        line = np.column_stack([np.full((n, 2), [0.5, 0.25]), rng.uniform(-0.9, 0.9, n)])
        target = line + [[1.0, -1.0, 0.0]] * 10.0 ** -rng.uniform(1, 6, (n, 1))
        o = target + [[0.1, 0.3, 0.06]] * rng.choice([-1.0, 1.0], (n, 1))
        w = unit_vectors(rng, n)
        found = Placed(shape).probe(o, target - o, w)
        curved = np.flatnonzero(np.isfinite(found.t) & (found.face == 0))
        assert len(curved) > n / 2
        for i in curved:
            x, y, _ = map(Fraction, found.start[i].tolist())
            f = (x - Fraction(1, 2)) ** 2 - (y - Fraction(1, 4)) ** 2
            assert (f > 0) == (w[i] @ found.n[i] > 0)
            assert f != 0
        d = np.array([[0.25, 0.75, 0.125]])
        found = Placed(shape).probe([[0.5, 0.25, 0.25]] - d * [[0.5], [1.0]], np.tile(d, (2, 1)))
        i = found.face == 0
        assert i.sum() == (0 if capped else 2)
        assert np.array_equal(found.p[i], np.tile([0.5, 0.25, 0.25], (i.sum(), 1)))
        assert (found.error[i] < 1e-6).all()


# ---- what there is to describe ------------------------------------------------------------------

NO_SURFACE = {
    "zero": (0, 0, 0, 0, 0, 0, 0, 0, 0, 0),
    "a constant": (0, 0, 0, 0, 0, 0, 0, 0, 0, 1),
    "a negative constant": (0, 0, 0, 0, 0, 0, 0, 0, 0, -1),
    "nowhere": (1, 2, 3, 0, 0, 0, 0, 0, 0, 4),
    "a point": (1, 1, 1, 0, 0, 0, 2, 0, 0, 1),
    "a line": (1, 1, 0, 1, 0, 0, 0, 0, 0, 0),
    "a plane met twice": (1, 4, 0, 4, 0, 0, 0, 0, 0, 0),
    "a plane met twice, from within": (-1, -4, 0, -4, 0, 0, 0, 0, 0, 0),
}


@pytest.mark.parametrize("coefficients", NO_SURFACE.values(), ids=NO_SURFACE)
def test_no_surface(coefficients):
    scene = rt.Scene(shapes=(quadric_of(*coefficients),))
    with pytest.raises(SceneError, match="f does not change its sign, so that there is no surface"):
        rt.build_tables(scene)
    # Capped, it is everything or nothing.
    rng = np.random.default_rng(13)
    shape = quadric_of(*coefficients, capped=True)
    o, d = Placed(rt.Sphere()).rays(rng, 200, (0.0, 1.0))
    whole = rt.Scene(shapes=(rt.Box(),)).intersect(o, d).t
    expected = whole if min(coefficients) < 0 or max(coefficients) == 0 else np.full(200, np.inf)
    assert np.allclose(Placed(shape).probe(o, d).t, expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"coefficients": [1, 2, 3]}, "expected ten numbers [A, B, C, D, E, F, G, H, I, J]"),
        ({"coefficients": [*range(9), math.nan]}, "finite"),
        ({"coefficients": [*range(9), "1"]}, "expected ten numbers"),
        ({"coefficients": [*range(9), 10**400]}, "expected finite numbers"),
        ({"upper": [1, -1, 1]}, "expected each coordinate of 'lower' to be below that of 'upper'"),
        ({"upper": [1, math.inf, 1]}, "finite"),
        ({"upper": None}, "[x, y, z]"),
    ],
)
def test_refused(fields, message):
    good = {"coefficients": [1, 1, 0, 0, 0, 0, 0, 0, -1, 0], "lower": [-1, -1, -1]}
    with pytest.raises(SceneError, match=re.escape(message)):
        rt.Quadric(**{**good, "upper": [1, 1, 1], **fields})


@pytest.mark.parametrize("scale", [1e-150, 1e150])
def test_sizes_that_overflow(scale):
    with pytest.raises(SceneError, match="its size overflows; expected a scale"):
        Placed(put(KINDS["saddle"][0], np.eye(3) * scale))


def test_a_box_far_away_that_a_map_brings_back():
    """The cap of a large sphere, in coordinates that begin at its middle: only the box counts."""
    r = 2.0**20
    here = rt.Quadric(
        coefficients=(1, 1, 1, 0, 0, 0, 0, 0, 0, -r * r),
        lower=(-1, -1, r - 1),
        upper=(1, 1, r + 1),
        transform=({"translate": [0, 0, -r]},),
    )
    x = np.linspace(-0.9, 0.9, 50)
    o = np.column_stack([x, 0.3 * x, np.full(50, 2.0)])
    found = Placed(here).probe(o, np.tile([0.0, 0.0, -1.0], (50, 1)))
    sag = (x**2 + 0.09 * x**2) / (r + np.sqrt(r * r - x**2 - 0.09 * x**2))
    assert np.allclose(found.t, 2.0 + sag, rtol=8 * U)

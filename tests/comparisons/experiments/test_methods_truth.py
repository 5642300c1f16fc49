"""`reference-rt methods`: its ground truth, its random tests, and its error measures, applied to
methods that are wrong on purpose."""

import math
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from methods_measured import SEED, series

from comparisons.experiments.methods import of_box, of_csg, of_hierarchy, of_polygon, of_sphere
from comparisons.experiments.methods.errors import PIXEL, Checked, U, measure, share_interval, truth
from comparisons.experiments.methods.run import FAMILIES, draw_trials
from comparisons.experiments.methods.setting import Draw, Trial
from comparisons.experiments.methods.timing import Prepared
from comparisons.geometry.exact import first_hit
from comparisons.geometry.exact.dyadic import NEVER, nearest
from reference_rt import textbook as ways

# ---- the truth -----------------------------------------------------------------------------------


def exact_box(lower, upper, o, d):
    """t in fractions, None for a miss."""
    near, far = -math.inf, math.inf
    for low, high, x, y in zip(*(map(Fraction, a) for a in (lower, upper, o, d)), strict=True):
        if y == 0:
            if not low <= x <= high:
                return None
            continue
        t0, t1 = sorted(((low - x) / y, (high - x) / y))
        near, far = max(near, t0), min(far, t1)
    t = near if near > 0 else far
    return t if near <= far and 0 < t < math.inf else None


@pytest.mark.parametrize("name", ["distance", "along axes", "from planes", "ridges", "flatness"])
def test_the_truth_about_boxes_is_that_of_fractions(name, tmp_path):
    (trial,) = draw_trials(series("box", name), "box", 1e2, SEED, 200, tmp_path)
    (box,) = trial.parts
    found = of_box.exact(box, trial.o, trial.d)
    for k in range(len(trial.o)):
        expected = exact_box(box.lower, box.upper, trial.o[k].tolist(), trial.d[k].tolist())
        assert (found.t[k] == NEVER) == (expected is None)
        if expected is not None:
            assert nearest(found.t[k : k + 1])[0] == float(expected)


def test_the_truth_about_polygons_is_that_of_their_triangles(tmp_path):
    """A quadrangle is two triangles; that its plane is exact shows where one is not."""
    (trial, *_) = draw_trials(series("polygon", "vertices"), "polygon", 4, SEED, 1600, tmp_path)
    (polygon,) = trial.parts
    a, b, c, d = np.asarray(polygon.rings[0])
    found = of_polygon.exact(polygon, trial.o, trial.d)
    halves = [
        first_hit("triangles", {"vertices": np.concatenate(v)[None]}, trial.o, trial.d).t
        for v in ((a, b, c), (a, c, d))
    ]
    np.testing.assert_array_equal(nearest(found.t), np.minimum(*halves))
    with pytest.raises(ValueError, match="exactly in a plane"):
        of_polygon.exact(
            ways.PolygonParameters([[a, b, c, d + np.array([0, 0, 1e-9])]]), trial.o, trial.d
        )


def test_the_truth_about_solids_is_that_of_what_is_left():
    """The sheared cube without a half is the other half, to the last bit."""
    shear = of_csg.transform.Matrix(matrix=of_csg.SHEAR)
    draw = Draw(np.random.default_rng(SEED), 300, None)
    (trial,) = of_csg.coincident(draw, 1.0)
    cut = of_csg.exact(trial.parts[0], trial.o, trial.d)
    left = of_csg.exact(ways.CsgParameters(of_csg.slab(0.5, -0.5, shear)), trial.o, trial.d)
    np.testing.assert_array_equal(nearest(cut.t), nearest(left.t))
    assert np.mean(cut.t != NEVER) > 0.5


@pytest.mark.parametrize("name", ["strewn", "clustered", "needles"])
def test_no_triangle_is_left_out_of_the_truth(name, tmp_path):
    """What floats choose for exact arithmetic is enough: the same as of all pairs."""
    (trial,) = draw_trials(series("hierarchy", name), "hierarchy", 100, SEED, 40, tmp_path)
    (part,) = trial.parts
    found = of_hierarchy.exact(part, trial.o, trial.d)
    v = of_hierarchy._vertices(part).reshape(-1, 9)
    t = [
        first_hit("triangles", {"vertices": v}, *(np.tile(x, (len(v), 1)) for x in ray)).t.min()
        for ray in zip(trial.o, trial.d, strict=True)
    ]
    np.testing.assert_array_equal(nearest(found.t), t)


# ---- the measures, on methods that are wrong on purpose ------------------------------------------


@pytest.fixture
def far_sphere(tmp_path):
    """Rays of which three in four hit a sphere from 10 radii away, checked."""
    family, some = FAMILIES["sphere"], series("sphere", "distance")
    (trial, *_) = draw_trials(some, "sphere", 10.0, SEED, 8 * 800, tmp_path)
    return Checked.of(family, some, trial, 800)


def errors_of(checked, answer):
    return measure([checked], lambda _trial, _n: answer, SEED)


def test_the_exact_answer_has_no_errors(far_sphere):
    t = nearest(far_sphere.truth.t)
    errors = errors_of(far_sphere, t)
    assert (errors.checked, errors.touching, errors.wrong) == (800, 0, 0)
    assert errors.hits == np.isfinite(t).sum() > 500
    # Rounded to nearest: half a unit in the last place of t is u t at most.
    assert 0.0 < errors.worst <= 1.0
    assert errors.median <= errors.p99 <= errors.worst


def test_planted_faults_are_counted(far_sphere):
    t = nearest(far_sphere.truth.t)
    hits, misses = np.flatnonzero(np.isfinite(t)), np.flatnonzero(np.isinf(t))
    t[hits[:7]] = [math.inf, math.nan, *[math.inf] * 5]
    t[misses[:5]] = 1.0
    length = far_sphere.length
    t[hits[10:13]] += 1.01 * PIXEL * length[hits[10:13]]
    t[hits[20:23]] += 0.99 * PIXEL * length[hits[20:23]]
    errors = errors_of(far_sphere, t)
    assert (errors.lost, errors.false, errors.misplaced) == (7, 5, 3)
    assert errors.ties == 0
    assert errors.share == 15 / 800
    low, high = errors.share_interval
    assert low < errors.share < high


def test_errors_are_in_units_of_t_and_size(far_sphere):
    t = nearest(far_sphere.truth.t)
    off = 1000.0 * U * (t + far_sphere.length)
    there = np.isfinite(t)
    errors = errors_of(far_sphere, np.where(there, t + np.where(there, off, 0.0), t))
    # Rounding of t and of the sum: one unit each.
    assert abs(errors.median - 1000.0) <= 2.0
    assert abs(errors.worst - 1000.0) <= 2.0
    relative = errors_of(replace(far_sphere, relative=True), t * (1.0 + 1000.0 * U))
    assert abs(relative.worst - 1000.0) <= 2.0


def test_ties_are_rays_on_the_fence_and_no_others(tmp_path):
    """Rays that pass the rim within 1e-16 radii are; those that pass at 1e-7 are not."""
    family, some = FAMILIES["sphere"], series("sphere", "rim")
    for gap, expected in ((1e16, 1.0), (1e7, 0.0)):
        (trial, *_) = draw_trials(some, "sphere", gap, SEED, 8 * 100, tmp_path)
        checked = Checked.of(family, some, trial, 100)
        ties = checked.ties(np.ones(100, bool), np.random.default_rng(SEED))
        assert np.mean(ties) == expected


def test_neighbours_are_one_shape(tmp_path):
    """A ray at a shared edge hits, whichever of its triangles has it; timing counts both."""
    (trial, *_) = draw_trials(series("triangle", "edges"), "triangle", 1.0, SEED, 1600, tmp_path)
    found = truth(FAMILIES["triangle"], trial, trial.o, trial.d)
    assert len(trial.parts) == 6
    assert np.all(found.t != NEVER)
    assert not found.touching.any()


def test_intervals_of_shares():
    """Closed forms of none and all; the ends are where the tails are 2.5 %."""
    assert share_interval(0, 100) == pytest.approx((0.0, 1.0 - 0.025**0.01))
    assert share_interval(100, 100) == pytest.approx((0.025**0.01, 1.0))
    low, high = share_interval(3, 20)
    tail = [math.comb(20, k) * low**k * (1.0 - low) ** (20 - k) for k in range(3, 21)]
    assert sum(tail) == pytest.approx(0.025)
    tail = [math.comb(20, k) * high**k * (1.0 - high) ** (20 - k) for k in range(4)]
    assert sum(tail) == pytest.approx(0.025)


# ---- settings ------------------------------------------------------------------------------------


def test_series_go_from_ordinary_to_extreme():
    for family in FAMILIES.values():
        assert len({some.name for some in family.series}) == len(family.series)
        for some in family.series:
            assert all(a < b for a, b in pairwise(some.values))
            assert some.values[-1] >= some.extreme
            assert bool(some.axis) == (len(some.values) > 1)
        assert any(some.values[0] < some.extreme for some in family.series)


def test_settings_are_drawn_from_their_seed_alone(tmp_path):
    some = series("triangle", "aspect")
    first, again, other = (
        draw_trials(some, "triangle", 1e3, seed, 160, tmp_path) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first[0].o, again[0].o)
    assert not np.array_equal(first[0].o, other[0].o)


def test_thin_triangles_are_as_thin_as_said(tmp_path):
    for trial in draw_trials(series("triangle", "aspect"), "triangle", 1e3, 1, 160, tmp_path):
        v = np.array(trial.parts[0])
        area = np.linalg.norm(np.cross(v[1] - v[0], v[2] - v[0]))
        assert 200.0 < trial.size**2 / area < 5000.0


def test_spheres_are_as_far_as_said(tmp_path):
    for trial in draw_trials(series("sphere", "distance"), "sphere", 1e5, 1, 800, tmp_path):
        (sphere,) = trial.parts
        distance = np.linalg.norm(trial.o - sphere.center, axis=1) / sphere.radius
        np.testing.assert_allclose(distance, 1e5, rtol=1e-12)
        found = of_sphere.exact(sphere, trial.o, trial.d)
        assert 0.6 < np.mean(found.t != NEVER) < 0.9


def test_answers_are_the_first_of_all_parts(tmp_path):
    """Two spheres, one behind the other, in either order."""
    near, far = (ways.SphereParameters((0, 0, z), 1.0) for z in (0.0, -5.0))
    o, d = np.array([[0.0, 0, 5], [0, 0, -10], [9, 0, 5]]), np.array([[0.0, 0, -1]] * 3)
    d[1] *= -1.0
    for parts in ((near, far), (far, near)):
        trial = Trial(parts, o, d, 2.0)
        prepared = Prepared(ways.METHODS["sphere.robust"], [trial])
        assert prepared.answer(trial, 3).tolist() == [4.0, 4.0, math.inf]
        assert nearest(truth(FAMILIES["sphere"], trial, o, d).t).tolist() == [4.0, 4.0, math.inf]
        assert prepared.nanoseconds(2) > 0.0

"""The light tree: a probability for every light that can shine, and the right one."""

import math

import numpy as np
import pytest
from builders import unit_vectors
from scipy.stats import chi2

from comparisons.statistics.chi_square import sidak
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import entry_kernel
from reference_rt.lights.emitters import point as points
from reference_rt.lights.emitters import spot as spots
from reference_rt.lights.emitters.point import Point
from reference_rt.lights.emitters.spot import Spot
from reference_rt.lights.selection import choice as light_tree
from reference_rt.lights.selection.bounds import LightBounds
from reference_rt.lights.selection.choice import build

U = 2.0**-53
ANY_SIDE = np.zeros(3)


@entry_kernel
def _probabilities(tree, p, n, out):
    for k in range(len(out)):
        out[k] = light_tree.probability_in_tree(tree, row(p, 0), row(n, 0), k)


@entry_kernel
def _picks(tree, p, n, u, light, probability):
    for k in range(len(u)):
        light[k], probability[k] = light_tree.pick_in_tree(tree, row(p, 0), row(n, 0), u[k])


def probabilities(tree, p, n):
    out = np.empty(len(tree.trail))
    with np.errstate(all="ignore"):
        _probabilities(tree, np.array([p], float), np.array([n], float), out)
    return out


def picks(tree, p, n, u):
    light, probability = np.empty(len(u), np.int64), np.empty(len(u))
    with np.errstate(all="ignore"):
        _picks(tree, np.array([p], float), np.array([n], float), u, light, probability)
    return light, probability


def random_points(rng, n):
    """Even lights without size: the whole of them shines everywhere."""
    c = rng.uniform(-5, 5, (n, 3))
    axis, intensity = np.tile([0.0, 0.0, 1.0], (n, 1)), 10.0 ** rng.uniform(-3, 1, n)
    return LightBounds(c, c, axis, np.full(n, math.pi), np.zeros(n), np.zeros(n), intensity)


def random_flats(rng, n, size=0.3):
    """Triangles: (bounds, corners (n, 3, 3))."""
    corners = rng.uniform(-5, 5, (n, 1, 3)) + rng.normal(size=(n, 3, 3)) * size
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(normal, axis=1)
    bounds = LightBounds(
        corners.min(axis=1),
        corners.max(axis=1),
        normal / (2 * area)[:, None],
        np.zeros(n),
        np.full(n, 0.5 * math.pi),
        area * 10.0 ** rng.uniform(-2, 1, n),
        np.zeros(n),
    )
    return bounds, corners


def irradiance(bounds, q, p, n):
    """Of lights as points q (n, 3): exact for those without size."""
    w = q - p
    distance2 = np.sum(w * w, axis=1)
    w /= np.sqrt(distance2)[:, None]
    leaving = np.maximum(0.0, -np.sum(w * bounds.axis, axis=1))
    arriving = np.maximum(0.0, w @ n) if n.any() else 1.0
    return (bounds.even + bounds.lambertian * leaving) * arriving / distance2


@pytest.mark.parametrize("count", [1, 2, 3, 10, 1000, 10_000])
def test_probabilities_sum_to_one(count):
    """Points seen from any side: no descent ends in the dark.  A product of d factors, each two
    roundings of exact shares, is right to 3 d u, and so is their sum."""
    rng = np.random.default_rng(411)
    tree = build(random_points(rng, count), np.arange(count), count)
    depth = max(int(t).bit_length() for t in tree.trail) + 1
    assert depth <= 60
    for p in rng.uniform(-8, 8, (4, 3)):
        found = probabilities(tree, p, ANY_SIDE)
        assert (found > 0).all()
        assert found.sum() == pytest.approx(1.0, rel=(3 * depth + 64) * U)


def test_never_dark_where_a_light_shines():
    """Every triangle of which some corner shines at the front of p has a probability; all together
    at most 1."""
    rng = np.random.default_rng(412)
    bounds, corners = random_flats(rng, 500)
    tree = build(bounds, np.arange(500), 500)
    grazing = 0
    for k in range(200):
        p, n = rng.uniform(-6, 6, 3), unit_vectors(rng, 1)[0]
        if k % 2:  # on a light's own plane and horizon, but for rounding
            p = corners[k] @ rng.uniform(-2, 2, 3)
            n = unit_vectors(rng, 1)[0]
            to_light = corners[k + 1, 0] - p
            n -= to_light * (n @ to_light) / (to_light @ to_light)
            n /= np.linalg.norm(n)
            grazing += 1
        found = probabilities(tree, p, n)
        assert found.sum() <= 1.0 + 1e-12
        for side in (n, ANY_SIDE):
            found = probabilities(tree, p, side)
            shines = np.max([irradiance(bounds, corners[:, i], p, side) for i in range(3)], axis=0)
            assert (found[shines > 0] > 0).all()
    assert grazing == 100


def test_pick_and_probability_are_one():
    """Bit for bit, and picked as often as it says: chi-square, and what is left over is dark."""
    rng = np.random.default_rng(413)
    p_values = []
    for count in (2, 7, 100, 3000):
        bounds, _ = random_flats(rng, count)
        for table in (bounds, random_points(rng, count)):
            tree = build(table, np.arange(count), count)
            for n in (ANY_SIDE, unit_vectors(rng, 1)[0]):
                p = rng.uniform(-6, 6, 3)
                expected = probabilities(tree, p, n)
                light, probability = picks(tree, p, n, rng.random(100_000))
                lit = probability > 0
                assert (probability[lit] == expected[light[lit]]).all()
                counts = np.append(np.bincount(light[lit], minlength=count), np.sum(~lit))
                means = 100_000 * np.append(expected, max(0.0, 1.0 - expected.sum()))
                if means[-1] < 1e-6:
                    assert counts[-1] == 0
                order = np.argsort(means)
                cells = np.minimum(np.cumsum(means[order]) // 20, 10_000)
                cells = np.unique(cells, return_inverse=True)[1]
                m, c = np.bincount(cells, means[order]), np.bincount(cells, counts[order])
                keep = m >= 5
                if keep.sum() > 1:
                    statistic = np.sum((c[keep] - m[keep]) ** 2 / m[keep])
                    p_values.append(chi2.sf(float(statistic), int(keep.sum()) - 1))
    assert len(p_values) >= 10
    assert min(p_values) > sidak(len(p_values))


def test_unbiased_and_better_than_by_power():
    """E[irradiance / probability] is the sum; its variance, by the exact sums, is below a third of
    what picking by power has, in the middle of places."""
    rng = np.random.default_rng(414)
    bounds, corners = random_flats(rng, 2000, size=1e-9)
    tree = build(bounds, np.arange(2000), 2000)
    power = bounds.lambertian / bounds.lambertian.sum()
    ratios = []
    for _ in range(30):
        p, n = rng.uniform(-5, 5, 3), unit_vectors(rng, 1)[0]
        shines = irradiance(bounds, corners[:, 0], p, n)
        chance = probabilities(tree, p, n)
        lit = shines > 0
        total = shines.sum()
        by_tree = np.sum(shines[lit] ** 2 / chance[lit]) - total**2
        by_power = np.sum(shines**2 / power) - total**2
        ratios.append(by_tree / by_power)
        light, probability = picks(tree, p, n, rng.random(20_000))
        estimate = np.divide(
            shines[light], probability, where=probability > 0, out=np.zeros(len(light))
        )
        error = math.sqrt(by_tree / len(light))
        assert abs(estimate.mean() - total) < 6 * error
    assert np.median(ratios) < 1 / 3


def test_lights_that_share_a_place():
    """Duplicates are equally likely, but for rounding; a thousand of them make a tree."""
    point = Point(position=(1, 2, 3), intensity=(1, 1, 1)).tabulate()
    many = points.bounds(
        point._replace(**{f: np.repeat(getattr(point, f), 1000, 0) for f in point._fields})
    )
    tree = build(many, np.arange(1000), 1000)
    assert probabilities(tree, [0, 0, 0], ANY_SIDE) == pytest.approx(1e-3, rel=1e-12)
    assert max(int(t).bit_length() for t in tree.trail) <= 12  # 8^4 lights
    here = probabilities(tree, [1, 2, 3], ANY_SIDE)
    assert np.isfinite(here).all()


def test_lights_at_powers_of_two():
    """Places that only a tree with one light at each step would tell apart: its depth is bounded,
    and the trails still lead to every light."""
    n = 900
    bounds = random_points(np.random.default_rng(415), n)
    place = np.column_stack([2.0 ** np.arange(-n / 2, n / 2), np.zeros(n), np.zeros(n)])
    tree = build(bounds._replace(lower=place, upper=place), np.arange(n), n)
    assert max(int(t).bit_length() for t in tree.trail) <= 60
    found = probabilities(tree, [0, 1, 0], ANY_SIDE)
    assert np.isfinite(found).all()
    assert found.sum() == pytest.approx(1.0, rel=1e-12)


def test_a_spot_in_the_tree_lights_its_cone_alone():
    spot = Spot(origin=(0, 0, 5), target=(0, 0, 0), intensity=(1, 1, 1), cutoff_angle=30)
    point = Point(position=(50, 0, 5), intensity=(1, 1, 1))
    parts = (spots.bounds(spot.tabulate()), points.bounds(point.tabulate()))
    bounds = LightBounds(*(np.concatenate(c) for c in zip(*parts, strict=True)))
    tree = build(bounds, np.array([3, 1]), 5)
    assert list(tree.trail >= 0) == [False, True, False, True, False]
    edge = 5 * math.tan(math.radians(30))
    for x, is_lit in ((0, True), (0.999 * edge, True), (1.001 * edge, False)):
        found = probabilities(tree, [x, 0, 0], ANY_SIDE)
        assert (found[3] > 0) == is_lit
        assert found[[0, 2, 4]].tolist() == [0, 0, 0]
        assert found.sum() == pytest.approx(1.0, rel=16 * U)
    # Straight below: 1 / 25 against 1 / (50² + 5²), to within the slack.
    expected = (1 / 25) / (1 / 25 + 1 / 2525)
    assert probabilities(tree, [0, 0, 0], ANY_SIDE)[3] == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize("intensity", [0.0, -1.0, math.inf, math.nan])
def test_lights_without_power_are_refused(intensity):
    bounds = random_points(np.random.default_rng(416), 3)
    bounds.even[1] = intensity
    with pytest.raises(ValueError, match="without power"):
        build(bounds, np.arange(3), 3)


def test_lights_that_are_not_finite_are_refused():
    bounds = random_points(np.random.default_rng(417), 3)
    bounds.lower[1, 2] = -math.inf
    with pytest.raises(ValueError, match="not finite"):
        build(bounds, np.arange(3), 3)
    with pytest.raises(ValueError, match="without power"):
        build(LightBounds(*(c[:0] for c in bounds)), np.arange(0), 0)

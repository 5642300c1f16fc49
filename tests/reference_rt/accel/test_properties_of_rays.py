"""What must hold for any scene and any rays: properties, with examples drawn by hypothesis.

All scenes have the same kinds of shapes, and so share kernels; all coordinates are multiples of
1/64, so that whole-number offsets and factors 2^k are exact and every bit must stay.
"""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import reference_rt as rt
from reference_rt.core import transform
from reference_rt.rendering import query

GRID = 64.0
RAYS = 200

seeds = st.integers(0, 2**32 - 1)
offsets = st.tuples(*[st.integers(-(2**40), 2**40)] * 3)


few = settings(max_examples=12)


def grid(rng, low, high, size=3):
    return tuple((np.rint(rng.uniform(low, high, size) * GRID) / GRID).tolist())


def at(rng):
    return transform.Translate(translate=grid(rng, -2, 2))


def turned(rng):
    axis = tuple(rng.normal(size=3).tolist())
    return transform.Rotate(rotate=transform.Turn(axis=axis, degrees=float(rng.uniform(0, 360))))


def size(rng):
    return float(rng.integers(16, 80) / GRID)


def shapes_of(rng):
    """One of each: what is turned is turned about its own origin."""

    def placed():
        return (transform.Scale(scale=(size(rng), size(rng), size(rng))), turned(rng), at(rng))

    bite = rt.Difference(
        of=(
            rt.Box(transform=(transform.Scale(scale=size(rng)),)),
            rt.Sphere(radius=size(rng)),
        ),
        transform=(at(rng),),
    )
    return (
        rt.Sphere(center=grid(rng, -2, 2), radius=size(rng)),
        rt.Box(transform=placed()),
        rt.Rectangle(transform=placed()),
        rt.Triangle(v0=grid(rng, -2, 0), v1=grid(rng, 0, 2), v2=grid(rng, -2, 2)),
        rt.Cylinder(radius=size(rng), transform=(turned(rng), at(rng))),
        bite,
    )


def group_of(rng):
    return (
        rt.Sphere(center=grid(rng, -1, 1), radius=size(rng)),
        rt.Triangle(v0=grid(rng, -1, 0), v1=grid(rng, 0, 1), v2=grid(rng, -1, 1)),
    )


def scene_of(seed, hierarchy="sah"):
    rng = np.random.default_rng(seed)
    return rt.Scene(
        hierarchy=hierarchy,
        groups={"g": group_of(rng)},
        shapes=(*shapes_of(rng), rt.Instance(group="g", transform=(turned(rng), at(rng)))),
    )


def rays_of(seed):
    """From multiples of 1/64; half towards the middle, half anywhere."""
    rng = np.random.default_rng((seed, 1))
    o = np.rint(rng.uniform(-4, 4, (RAYS, 3)) * GRID) / GRID
    d = np.where(rng.random((RAYS, 1)) < 0.5, rng.normal(size=(RAYS, 3)) - o, rng.normal(size=3))
    return o, d


def then(scene, *steps):
    """All shapes of a scene, followed by steps."""
    shapes = tuple(s.model_copy(update={"transform": (*s.transform, *steps)}) for s in scene.shapes)
    return scene.changed(shapes=shapes)


def assert_same(one, two, factor=1.0, names=("shape", "primitive", "part", "instance")):
    assert np.array_equal(one.t * factor, two.t)
    for name in names:
        assert np.array_equal(getattr(one, name), getattr(two, name)), name


@pytest.mark.slow
@few
@given(seeds, st.integers(-150, 150))
def test_a_power_of_two_larger(seed, k):
    scene, (o, d) = scene_of(seed), rays_of(seed)
    factor = 2.0**k
    other = then(scene, transform.Scale(scale=(factor,) * 3))
    assert_same(scene.intersect(o, d), other.intersect(o * factor, d), factor)


def crossings_of_bite(bite, o, d):
    """t (n, 4) and cosines (n, 4) of the box's and the sphere's ends along rays, nan for a miss."""
    box, ball = bite.of
    (center,) = bite.transform
    o, half = o - center.translate, box.transform[0].scale[0]
    slabs = np.sort(np.stack([-half - o, half - o]) / d, axis=0)
    enters, leaves = slabs[0].max(axis=1), slabs[1].min(axis=1)
    away = np.linalg.norm(d, axis=1)
    rows = np.arange(len(o))
    cosines = [np.abs(d[rows, slabs[0].argmax(axis=1)]), np.abs(d[rows, slabs[1].argmin(axis=1)])]
    middle = -(o * d).sum(axis=1) / away**2
    beside = np.linalg.norm(o + middle[:, None] * d, axis=1)
    with np.errstate(invalid="ignore"):
        chord = np.sqrt((ball.radius - beside) * (ball.radius + beside))
    t = np.stack([enters, leaves, middle - chord / away, middle + chord / away], axis=1)
    t[enters > leaves, :2] = np.nan
    ends = np.stack([cosines[0] / away, cosines[1] / away, *[chord / ball.radius] * 2], axis=1)
    return t, ends


def are_one(t, cosine, o, d, reach):
    """(n,): whether two crossings of a ray, or one and its origin, lie within `reach` / cosine of
    each other."""
    away = np.linalg.norm(d, axis=1, keepdims=True)
    with np.errstate(divide="ignore"):
        t, width = np.append(0.0 * away, t * away, axis=1), reach / cosine
    width = np.append(0.0 * away, width, axis=1)
    apart = np.abs(t[:, :, None] - t[:, None, :]) <= width[:, :, None] + width[:, None, :]
    return (apart & ~np.eye(5, dtype=bool)).any(axis=(1, 2))


@few
@given(seeds, offsets)
def test_somewhere_else(seed, offset):
    """Solids count crossings as one that lie within the rounding of where they are: 16 sqrt(3) u
    (|anchor| + |p| + size) of the surface and 16 sqrt(3) u (|o| + |p|) of the ray, over the cosine
    (`csg.width`), 111 u times the largest number at most.  Only rays of which crossings
    are that close may differ."""
    scene, (o, d) = scene_of(seed), rays_of(seed)
    other = then(scene, transform.Translate(translate=offset))
    one, two = scene.intersect(o, d), other.intersect(o + offset, d)
    same = (one.t == two.t) & (one.shape == two.shape) & (one.primitive == two.primitive)
    (bite,) = [s for s in scene.shapes if isinstance(s, rt.Difference)]
    reach = 112 * 2.0**-53 * (max(map(abs, offset)) + 8.0)
    t, cosine = crossings_of_bite(bite, o, d)
    assert (same | are_one(t, cosine, o, d, reach)).all()


def test_crossings_of_bite():
    """Near the origin hardly any are one, and those that show are among them."""
    few_close = []
    for seed in range(20):
        scene, (o, d) = scene_of(seed), rays_of(seed)
        (bite,) = [s for s in scene.shapes if isinstance(s, rt.Difference)]
        t, cosine = crossings_of_bite(bite, o, d)
        few_close.append(are_one(t, cosine, o, d, 112 * 2.0**-53 * 8.0).mean())
        found = scene.intersect(o, d)
        met = found.shape == scene.shapes.index(bite)
        off = np.abs(t[met] - found.t[met, None])
        assert (np.nanmin(off, axis=1) < 1e-13 * (1.0 + found.t[met])).all()
    assert np.mean(few_close) < 1e-3


@few
@given(seeds, st.randoms(use_true_random=False))
def test_any_order(seed, random):
    scene, (o, d) = scene_of(seed), rays_of(seed)
    order = list(range(len(scene.shapes)))
    random.shuffle(order)
    other = scene.changed(shapes=tuple(scene.shapes[k] for k in order))
    one, two = scene.intersect(o, d), other.intersect(o, d)
    assert_same(one, two, names=("primitive", "part", "instance"))
    assert np.array_equal(one.shape, np.append(order, -1)[two.shape])


@few
@given(seeds)
def test_any_hierarchy(seed):
    o, d = rays_of(seed)
    expected = scene_of(seed).intersect(o, d)
    for hierarchy in ("median", "spatial", "none"):
        found = scene_of(seed, hierarchy).intersect(o, d)
        for field in dataclasses.fields(expected):
            assert np.array_equal(getattr(expected, field.name), getattr(found, field.name))


@few
@given(seeds, st.tuples(*[st.integers(-(2**20), 2**20)] * 3))
def test_an_instance_is_what_stands_there(seed, offset):
    """A group under a translation, against its shapes under that translation."""
    rng = np.random.default_rng(seed)
    step = transform.Translate(translate=offset)
    scene = scene_of(seed)
    group = group_of(rng)
    drawn = scene.changed(
        groups={"g": group}, shapes=(*scene.shapes[:-1], rt.Instance(group="g", transform=(step,)))
    )
    baked = tuple(s.model_copy(update={"transform": (step,)}) for s in group)
    # The instance that is left keeps the kinds, and is where no ray goes.
    away = rt.Instance(group="g", transform=(transform.Translate(translate=(0, 0, 2.0**60)),))
    stood = scene.changed(groups={"g": group}, shapes=(*scene.shapes[:-1], *baked, away))
    o, d = rays_of(seed)
    o = o + np.where(np.arange(RAYS)[:, None] % 2 == 0, offset, 0.0)
    one, two = drawn.intersect(o, d), stood.intersect(o, d)
    assert np.array_equal(one.t, two.t)
    last = len(scene.shapes) - 1
    assert np.array_equal(np.where(one.shape == last, last + one.part, one.shape), two.shape)
    assert np.array_equal(one.primitive * (one.shape < last), two.primitive * (two.shape < last))


@few
@given(seeds, st.sampled_from([rt.Union, rt.Intersection]))
def test_unions_and_intersections_commute(seed, operation):
    rng = np.random.default_rng(seed)
    scene = scene_of(seed)
    a = rt.Box(transform=(transform.Scale(scale=size(rng)), turned(rng)))
    b = rt.Sphere(center=grid(rng, -1, 1), radius=size(rng))
    rest = tuple(s for s in scene.shapes if not isinstance(s, rt.Difference))
    o, d = rays_of(seed)
    one = scene.changed(shapes=(*rest, operation(of=(a, b)))).intersect(o, d)
    two = scene.changed(shapes=(*rest, operation(of=(b, a)))).intersect(o, d)
    assert_same(one, two, names=("shape", "instance", "primitive"))
    solid = one.shape == len(rest)
    assert np.array_equal(one.part[solid], 1 - two.part[solid])


@few
@given(seeds, st.integers(-100, 100))
def test_longer_directions(seed, k):
    """t counts in units of |d|."""
    scene, (o, d) = scene_of(seed), rays_of(seed)
    assert_same(scene.intersect(o, d), scene.intersect(o, d * 2.0**k), 2.0**-k)


@few
@given(seeds)
def test_the_way_back_is_free(seed):
    """From just before what was hit, back to the origin, nothing is in the way."""
    scene, (o, d) = scene_of(seed), rays_of(seed)
    t = scene.intersect(o, d).t
    hit = np.isfinite(t)
    # A millionth short: points are off by 1e-14, which at a cosine of 1e-8 is that along the ray.
    short = t[hit] * (1.0 - 1e-6)
    p = o[hit] + d[hit] * short[:, None]
    # And a millionth short of the origin, which may lie on a surface itself.
    assert not scene.occluded(p, -d[hit], short * (1.0 - 1e-6)).any()


@few
@given(seeds, st.floats(0.0, 2.0))
def test_occluded_is_hit_before_the_end(seed, part):
    """0 < t < t_max, to the last bit: nothing lies before t itself, something before the next."""
    scene, (o, d) = scene_of(seed), rays_of(seed)
    t = scene.intersect(o, d).t
    assert np.array_equal(scene.occluded(o, d), np.isfinite(t))
    end = np.where(np.isfinite(t), t, 1.0) * part
    assert np.array_equal(scene.occluded(o, d, end), t < end)
    assert not scene.occluded(o, d, t)[np.isfinite(t)].any()
    assert scene.occluded(o, d, np.nextafter(t, np.inf))[np.isfinite(t)].all()


@few
@given(seeds, st.permutations(range(RAYS)))
def test_rays_know_nothing_of_each_other(seed, order):
    scene, (o, d) = scene_of(seed), rays_of(seed)
    one, two = scene.intersect(o, d), scene.intersect(o[order], d[order])
    for field in dataclasses.fields(one):
        assert np.array_equal(getattr(one, field.name)[order], getattr(two, field.name))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(300))
def test_many_scenes(seed):
    """The properties with no example of their own to shrink, over many scenes."""
    for test, arguments in (
        (test_a_power_of_two_larger, (int(np.random.default_rng(seed).integers(-150, 150)),)),
        (test_any_hierarchy, ()),
        (test_the_way_back_is_free, ()),
        (test_occluded_is_hit_before_the_end, (0.5,)),
    ):
        test.hypothesis.inner_test(seed, *arguments)


def test_the_scenes_are_worth_it():
    """Rays hit every shape."""
    met = set()
    for seed in range(5):
        met |= set(query.intersect(scene_of(seed).tables, *rays_of(seed)).shape.tolist())
    assert met == set(range(-1, 7))

"""What must hold for any scene and any rays: properties, with examples drawn by hypothesis.

F5, F7 and F9 of the stability suites move, scale, turn, reorder and group scenes."""

import dataclasses

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import reference_rt as rt
from reference_rt.core import transform
from reference_rt.rendering import query

GRID = 64.0
RAYS = 200

seeds = st.integers(0, 2**32 - 1)
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


def scene_of(seed):
    rng = np.random.default_rng(seed)
    return rt.Scene(
        groups={"g": group_of(rng)},
        shapes=(*shapes_of(rng), rt.Instance(group="g", transform=(turned(rng), at(rng)))),
    )


def rays_of(seed):
    """From multiples of 1/64; half towards the middle, half anywhere."""
    rng = np.random.default_rng((seed, 1))
    o = np.rint(rng.uniform(-4, 4, (RAYS, 3)) * GRID) / GRID
    d = np.where(rng.random((RAYS, 1)) < 0.5, rng.normal(size=(RAYS, 3)) - o, rng.normal(size=3))
    return o, d


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


def test_the_scenes_are_worth_it():
    """Rays hit every shape."""
    met = set()
    for seed in range(5):
        met |= set(query.intersect(scene_of(seed).tables, *rays_of(seed)).shape.tolist())
    assert met == set(range(-1, 7))

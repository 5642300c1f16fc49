"""Estimators of one number agree: sampling strategies, with and without roulette, `direct`."""

import dataclasses

import numpy as np
import pytest
from worlds import MATERIALS, at, facing, world, write_sky

import reference_rt as rt
from reference_rt.core import transform

REPLICATES = 32
ERRORS = 4.0
"""Standard errors that the means of a picture may differ by."""
TILE_ERRORS = 6.1
"""The same for one of 1344 tiles, channels, comparisons and scenes: 1e-3 for all of them (Šidák) by
Student's t with 31 degrees of freedom, of which Welch's test has at least as many
(scipy.stats.t.isf)."""
POWER = 2.33
"""99 % of a normal distribution lies below so many standard deviations."""


def floor(material, y=-1.0):
    scale = transform.Scale(scale=(4.0, 4.0, 1.0))
    return rt.Rectangle(material=material, transform=(scale, *facing((1, 0, 0), -90), *at(0, y, 0)))


def panel(material, x, y, z, size):
    """A level lamp that shines down."""
    scale = transform.Scale(scale=(size, size, 1.0))
    return rt.Rectangle(material=material, transform=(scale, *facing((1, 0, 0), 90), *at(x, y, z)))


def ball(material, x, y, z, radius=0.6):
    return rt.Sphere(center=(x, y, z), radius=radius, material=material)


def tetrahedron(tmp_path, material):
    (tmp_path / "lamp.obj").write_text(
        "v 0 1.2 -1.5\nv 1.2 1 -1.7\nv 0.6 1.9 -1.6\nv 0.6 1.3 -0.8\n"
        "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
    )
    return rt.Mesh(file=str(tmp_path / "lamp.obj"), material=material)


EXTRA = {
    "bright": rt.Emissive(radiance=(9, 8, 7), base="floor"),
    "chequered lamp": rt.Emissive(radiance="bright and dim", base="plastic"),
    "veil": rt.Mask(base="floor", opacity="white and black"),
    "both sides": rt.TwoSided(base="rough plastic", back="checks"),
    "mixed": rt.Blend(first="rough gold", second="floor", weight="white and black"),
    "silvered": rt.Blend(first="silver", second="checks", weight=0.7),
}
POINT = rt.Point(position=(-1.5, 1.5, 1.0), intensity=(4, 5, 6))
SPOT = rt.Spot(origin=(1, 2, 1), target=(0, -1, 0), intensity=(4, 3, 3), cutoff_angle=40)
SUN = rt.Directional(direction=(1, -2, -1), irradiance=(2, 2, 1))


def scenes(tmp_path):
    """name -> (shapes, lights, scale of the sky)."""
    return {
        "glossy, diffuse, glass": (
            (
                floor("floor"),
                ball("brushed gold", -0.8, -0.4, 0.0),
                ball("glass", 0.6, -0.4, 0.5),
                tetrahedron(tmp_path, "bright"),
                panel("lamp", -1.0, 2.0, 0.0, 1.5),
            ),
            (POINT,),
            0.06,
        ),
        "textures and masks": (
            (
                floor("checks"),
                ball("mixed", -0.8, -0.4, 0.0),
                panel("chequered lamp", 0.5, 1.5, 0.0, 1.8),
                rt.Disk(material="veil", transform=(*facing((0, 1, 0), 20), *at(0.7, 0, 0.5))),
                rt.Rectangle(material="both sides", transform=at(0, 0, -1.5)),
            ),
            (POINT,),
            0.04,
        ),
        "coats": (
            (
                floor("rough plastic"),
                ball("principled", -0.9, -0.4, 0.0),
                ball("frosted glass", 0.3, -0.6, 0.6, 0.4),
                ball("plastic", 1.0, -0.4, -0.6),
                panel("bright", -1.0, 2.0, 0.0, 2.5),
            ),
            (SPOT,),
            0.1,
        ),
        "lamps": (
            (
                floor("floor"),
                ball("lamp", -1.0, 0.3, -0.5, 0.4),
                rt.Disk(
                    material="bright",
                    transform=(
                        transform.Scale(scale=(0.5, 0.5, 1)),
                        *facing((0, 1, 0), 60),
                        *at(-1.8, 0, 0),
                    ),
                ),
                rt.Triangle(v0=(1, 1, -1), v1=(2, 1, -1), v2=(1.5, 1, 0), material="bright"),
                ball("silvered", 0.5, -0.4, 0.0),
            ),
            (SUN, SPOT),
            0.04,
        ),
    }


def scene_of(name, tmp_path, with_points=True):
    shapes, lights, scale = scenes(tmp_path)[name]
    write_sky(tmp_path / "sky.exr")
    sky = rt.EnvironmentMap(
        file=str(tmp_path / "sky.exr"), scale=scale, transform=facing((0, 1, 0), 30)
    )
    return world(
        *shapes,
        lights=lights if with_points else (),
        environment=sky,
        materials=MATERIALS | EXTRA,
        textures={"bright and dim": rt.Checker(first=(9, 8, 7), second=(1, 2, 3))},
        camera=rt.Orthographic(eye=(0, 0.8, 6), target=(0, 0, 0), width=3.6),
        film=rt.Film(width=32, height=32),
    )


def replicates(scene, integrator, spp, seed, sampler=rt.Sobol, tables=None):
    """(R, 32, 32, 3); how lights are picked is by default as the integrator likes it."""
    tables = scene.changed(integrator=integrator).tables if tables is None else tables
    return np.array(
        [
            rt.render(
                scene.changed(integrator=integrator, sampler=sampler(spp=spp, seed=seed + r)),
                tables=tables,
            ).colour
            for r in range(REPLICATES)
        ]
    )


def assert_agree(a, b, what, power=0.02):
    """Welch's test of two sets of replicates, for each channel of the picture and for each channel
    of each tile of 8 x 8 pixels; for the picture a difference of `power` would have been seen."""
    difference, error = welch(a.mean(axis=(1, 2)), b.mean(axis=(1, 2)))
    scale = a.mean(axis=(0, 1, 2))
    assert (np.abs(difference) <= ERRORS * error).all(), (what, difference / error)
    assert ((ERRORS + POWER) * error <= power * scale).all(), (what, error / scale)
    tiles = [x.reshape(-1, 4, 8, 4, 8, 3).mean(axis=(2, 4)) for x in (a, b)]
    difference, error = welch(*tiles)
    excess = np.abs(difference) / np.maximum(error, 1e-12 * scale)
    assert excess.max() <= TILE_ERRORS, (what, np.unravel_index(excess.argmax(), excess.shape))
    return excess.max()


def welch(a, b):
    """(difference of the means, its standard error)."""
    variance = (a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)) / len(a)
    return a.mean(axis=0) - b.mean(axis=0), np.sqrt(variance)


NAMES = {"glossy, diffuse, glass": 16, "textures and masks": 32, "coats": 32, "lamps": 16}
"""Samples for each pixel of each of 32 replicates."""

BUDGETS = [
    pytest.param(1, 0.02, id="fast"),
    pytest.param(4, 0.01, id="long", marks=pytest.mark.slow),
]
"""How many times that, and the difference of the means that it would show."""


@pytest.mark.slow
@pytest.mark.parametrize(("times", "power"), BUDGETS)
@pytest.mark.parametrize("name", NAMES)
def test_path_tracers(name, times, power, tmp_path):
    scene, spp = scene_of(name, tmp_path), times * NAMES[name]
    reference = replicates(scene, rt.Path(max_depth=6), spp, seed=1000)
    others = {
        "lights": rt.Path(max_depth=6, sampling="lights"),
        "bsdf": rt.Path(max_depth=6, sampling="bsdf"),
    }
    if times > 1:  # furnaces know what roulette must leave
        others["no roulette"] = rt.Path(max_depth=6, rr_depth=100)
        others["roulette from the start"] = rt.Path(max_depth=6, rr_depth=1)
    for k, (what, integrator) in enumerate(others.items()):
        found = replicates(scene, integrator, spp, seed=2000 + 100 * k)
        assert_agree(reference, found, what, power)


@pytest.mark.slow
@pytest.mark.parametrize(("times", "power"), BUDGETS)
@pytest.mark.parametrize("name", NAMES)
def test_direct_light(name, times, power, tmp_path):
    scene, spp = scene_of(name, tmp_path), times * NAMES[name]
    reference = replicates(scene, rt.Path(max_depth=2), spp, seed=3000)
    for k, (n, m) in enumerate(((3, 2), (1, 1))[:times]):
        integrator = rt.Direct(light_samples=n, bsdf_samples=m)
        found = replicates(scene, integrator, spp, seed=4000 + 100 * k)
        assert_agree(reference, found, (n, m), power)
    # Without samples of lights none that is a point or a direction is seen.
    scene = scene_of(name, tmp_path, with_points=False)
    reference = replicates(scene, rt.Path(max_depth=2), spp, seed=5000)
    found = replicates(scene, rt.Direct(light_samples=0, bsdf_samples=3), spp, seed=6000)
    assert_agree(reference, found, "material alone", power)


def many_lamps():
    """28 lights around a floor and a ball of frosted glass, which takes light from both sides."""
    rng = np.random.default_rng(9)
    lamps = [
        ball(f"lamp {k % 3}", *rng.uniform((-2, 0.5, -2), (2, 2.0, 2)), rng.uniform(0.05, 0.15))
        for k in range(16)
    ]
    points = [
        rt.Point(
            position=tuple(rng.uniform((-3, 0.5, -3), (3, 2.5, 3))),
            intensity=tuple(rng.uniform(0, 0.3, 3)),
        )
        for _ in range(12)
    ]
    colours = ((9, 3, 1), (1, 6, 2), (4, 4, 9))
    return rt.Scene(
        materials={f"lamp {k}": rt.Emissive(radiance=c) for k, c in enumerate(colours)}
        | {"floor": MATERIALS["floor"], "frosted": MATERIALS["frosted glass"]},
        shapes=(floor("floor"), ball("frosted", 0.0, -0.4, 0.0), *lamps),
        lights=(*points, rt.Constant(radiance=0.1)),
        camera=rt.Orthographic(eye=(0, 0.8, 6), target=(0, 0, 0), width=3.6),
        film=rt.Film(width=32, height=32),
    )


@pytest.mark.slow
@pytest.mark.parametrize(("times", "power"), BUDGETS)
def test_the_light_tree(times, power):
    """What the tree picks, and what scattered rays meet without it."""
    scene, spp = many_lamps(), 16 * times
    assert scene.tables.lights.tree is not None
    reference = replicates(scene, rt.Path(max_depth=4), spp, seed=9000)
    for k, sampling in enumerate(("lights", "bsdf")):
        path = rt.Path(max_depth=4, sampling=sampling)
        found = replicates(scene, path, spp, seed=9100 + 100 * k)
        assert_agree(reference, found, sampling, power)


@pytest.mark.slow
def test_the_light_tree_and_power():
    """How lights are picked is a matter of noise alone (another kernel)."""
    scene = many_lamps()
    spp = 64
    reference = replicates(scene, rt.Path(max_depth=4), spp, seed=9000)
    for k, sampling in enumerate(("both", "lights")):
        path = rt.Path(max_depth=4, sampling=sampling)
        tables = scene.changed(integrator=path).tables
        by_power = dataclasses.replace(tables, lights=tables.lights._replace(tree=None))
        found = replicates(scene, path, spp, seed=9100 + 100 * k, tables=by_power)
        assert_agree(reference, found, f"by power, {sampling}", 0.01)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_independent_samples(name, tmp_path):
    """Sobol' points have the mean of independent ones (another kernel: a minute to compile)."""
    scene = scene_of(name, tmp_path)
    reference = replicates(scene, rt.Path(max_depth=6), 256, seed=7000)
    found = replicates(scene, rt.Path(max_depth=6), 256, 8000, sampler=rt.Independent)
    assert_agree(reference, found, "independent", 0.01)

"""What a scene's queries for rays, lights and radiance return, against Mitsuba's counterpart."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from counterparts import coarse_meshes, counterpart_of, every_material, every_shape
from query_scene import LIT

from comparisons.geometry.frame import UNIT_ROUNDOFF, delta, round32
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.counterpart import Counterpart, trace
from comparisons.mitsuba.scene import for_rays
from comparisons.rungs.rays.plugin_trees import PluginTrees
from comparisons.rungs.rays.rays import Rays
from reference_rt import Direct, Scene, Whitted
from reference_rt import Path as PathTracing
from reference_rt.core.arrays import FloatArray
from reference_rt.shapes import Primitive
from reference_rt.shapes.csg import Difference
from reference_rt.shapes.instances import Instance

SIZE = 6.0
"""No shape reaches further from its own centre."""


@pytest.fixture(scope="module")
def scene(image_folder: Path) -> Scene:
    return every_material(image_folder)


@pytest.fixture(scope="module")
def counterpart(scene: Scene) -> Counterpart:
    return counterpart_of(scene)


def chords(n: int, seed: int) -> tuple[FloatArray, FloatArray]:
    """Rays that float32 can hold, from around the scene through it."""
    rng = np.random.default_rng(seed)
    o, to = rng.normal(size=(2, n, 3))
    o = round32(8.0 * o / np.linalg.norm(o, axis=1, keepdims=True))
    d = 1.5 * to - o
    return o, round32(d / np.linalg.norm(d, axis=1, keepdims=True))


# ---- rays -------------------------------------------------------------------------------------


def test_intersect_and_its_limits(scene: Scene, counterpart: Counterpart) -> None:
    """Hits of `ray_intersect` beyond t_min: of rays that Mitsuba starts there."""
    o, d = chords(4000, 1)
    for start in (0.0, 7.0):
        ours, theirs = scene.intersect(o, d, t_min=start), trace(counterpart, o + start * d, d)
        same = ours.shape == theirs.shape
        # Others pass an outline, or the place where Mitsuba's ray was put, within float32.
        assert same.mean() > 0.998
        met = same & ours.hit
        off = np.abs(ours.t[met] - start - theirs.t[met])
        cosine = np.abs(np.sum(ours.n * d, axis=1))[met]
        bound = delta(o[met], ours.p[met], np.full(met.sum(), SIZE))
        assert (off <= 2.0 * bound / cosine).all()
        assert np.array_equal(ours.hit, scene.first_hits(o, d, t_min=start).hit)


def test_occluded_is_ray_test(scene: Scene, counterpart: Counterpart) -> None:
    mi = mitsuba()
    o, d = chords(4000, 2)
    ends = np.random.default_rng(3).uniform(3.0, 12.0, len(o))

    def test(origin: Any, direction: Any, end: Any) -> tuple[Any, ...]:
        ray = mi.Ray3f(mi.Point3f(origin), direction)
        ray.maxt = end
        return (mi.Float(counterpart.mi_scene.ray_test(ray)),)

    theirs = for_rays(test, o, d, ends)[0] != 0.0
    ours = scene.occluded(o, d, t_max=ends)
    assert 0.2 < ours.mean() < 0.9
    assert (ours == theirs).mean() > 0.998  # outlines, and ends at a surface, within float32


@pytest.fixture(scope="module")
def shapes(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return every_shape(tmp_path_factory.mktemp("shapes"))


def test_every_type_of_shape_is_compared(shapes: Scene) -> None:
    found = {type(shape) for shape in shapes.shapes}
    assert found == {*Primitive.__args__, Instance, Difference}  # of set operations one


@pytest.mark.slow
def test_crossings_are_repeated_ray_intersections(shapes: Scene) -> None:
    """Of rays whose crossings are so far apart that Mitsuba can leave each without passing two."""
    with coarse_meshes(512, 256):
        counterpart = counterpart_of(shapes)
    o, d = chords(2000, 4)
    step = 1e-3
    found = shapes.crossings(o, d)
    gaps = np.full(len(o), np.inf)
    inner = np.flatnonzero(np.diff(found.ray) == 0)
    np.minimum.at(gaps, found.ray[inner], np.diff(found.t)[inner])
    # After a step a ray must be off the surface by more than float32 moves that, some 1e-5 here.
    steep = np.ones(len(o))
    np.minimum.at(steep, found.ray, np.abs(np.sum(found.n * d[found.ray], axis=1)))
    clear = (gaps > 4.0 * step) & (steep > 0.05)
    t, wrong = np.zeros(len(o)), np.zeros(len(o), bool)
    for k in range(int(found.count.max()) + 1):
        theirs = trace(counterpart, o + t[:, None] * d, d)
        there = found.count > k
        at = np.minimum(found.first[:-1] + k, len(found.t) - 1)
        wrong |= (theirs.shape >= 0) != there
        wrong |= there & (theirs.shape != found.shape[at])
        wrong |= there & ~(np.abs(np.minimum(theirs.t, 100.0) + t - found.t[at]) < step)
        t = np.where(there, found.t[at] + step, t)
    assert clear.mean() > 0.8
    met = set(found.shape[clear[found.ray]].tolist())
    assert met == set(range(len(shapes.shapes)))
    assert found.count[clear].max() >= 8
    assert wrong[clear].mean() < 0.002  # outlines, within float32 and the meshes that stand in


# ---- lights -----------------------------------------------------------------------------------


def reference_point(p: Any) -> Any:
    """What Mitsuba samples lights for."""
    mi = mitsuba()
    import drjit as dr  # after the choice of its LLVM

    it = dr.zeros(mi.SurfaceInteraction3f)
    it.t, it.p, it.n = 1.0, mi.Point3f(p), mi.Normal3f(0.0, 1.0, 0.0)
    it.sh_frame = mi.Frame3f(it.n)
    return it


POINTS = np.array([[0.3, 1.0, 1.0], [-2.0, 1.0, 3.0], [3.5, 0.5, -2.0]])


def test_samples_of_lights_bring_the_same_light(scene: Scene, counterpart: Counterpart) -> None:
    """The irradiance of a surface that faces up, and the light from everywhere: by the means of
    `sample_emitter_direction`, whose lights are picked by other chances."""
    mi = mitsuba()
    n = 100_000
    rng = np.random.default_rng(7)
    for p in POINTS:
        ours = scene.sample_lights(p, rng.uniform(size=(n, 3)))
        kept = ours.pdf > 0.0
        brought = np.where(kept[:, None], ours.radiance / np.where(kept, ours.pdf, 1.0)[:, None], 0)

        def sample(p: Any, u: Any, v: Any) -> tuple[Any, ...]:
            drawn, weight = counterpart.mi_scene.sample_emitter_direction(
                reference_point(p), mi.Point2f(u, v), False
            )
            return drawn.d, weight

        d, weight = for_rays(sample, np.tile(p, (n, 1)), *rng.uniform(size=(2, n)))
        for wi, light in ((ours.wi, brought), (d, weight)):
            assert np.isfinite(light).all()
            assert (np.abs(np.linalg.norm(wi[light.max(axis=1) > 0], axis=1) - 1) < 1e-5).all()
        sums = []
        for wi, light in ((ours.wi, brought), (d, weight)):
            up = light * np.maximum(wi[:, 1:2], 0.0)
            both = np.concatenate([up, light], axis=1)
            sums.append((both.mean(axis=0), both.var(axis=0) / n))
        (a, a_error), (b, b_error) = sums
        assert (np.abs(a - b) <= 5.0 * np.sqrt(a_error + b_error)).all()


def test_lights_have_the_same_densities(scene: Scene, counterpart: Counterpart) -> None:
    """`pdf_emitter_direction` of what rays from a point meet, the choice of the light apart."""
    mi = mitsuba()
    sources = scene.light_sources()
    emitters = len(sources.shape)
    assert emitters == len(counterpart.mi_scene.emitters()) <= 8  # a few: picked by power alone
    rng = np.random.default_rng(8)
    n = 4000
    for p in POINTS:
        d = rng.normal(size=(n, 3))
        d[: n // 2] = scene.sample_lights(p, rng.uniform(size=(n // 2, 3))).wi
        d = d[np.abs(d).max(axis=1) > 0.0]
        d = round32(d / np.linalg.norm(d, axis=1, keepdims=True))

        def density(o: Any, w: Any) -> tuple[Any, ...]:
            it = reference_point(o)
            si = counterpart.mi_scene.ray_intersect(mi.Ray3f(it.p, w))
            ds = mi.DirectionSample3f(counterpart.mi_scene, si, it)
            is_hit = si.emitter(counterpart.mi_scene) != None  # noqa: E711
            found = counterpart.mi_scene.pdf_emitter_direction(it, ds, is_hit)
            return (found,)

        theirs = for_rays(density, np.tile(p, (len(d), 1)), d)[0] * emitters
        hits = scene.intersect(p, d)
        number = np.where(hits.hit, -1, np.flatnonzero(sources.light == 3)[0])
        for k in np.flatnonzero(sources.shape >= 0):
            number[hits.shape == sources.shape[k]] = k
        lit = number >= 0
        ours = scene.light_pdf(p, d)
        assert not ours[~lit].any()
        chance = sources.probability[number]
        with np.errstate(invalid="ignore"):
            own = np.where(lit, ours / chance, 0.0)
        cosine = np.where(hits.hit, np.abs(np.sum(hits.n * d, axis=1)), 1.0)
        bound = own * 64.0 * UNIT_ROUNDOFF * (1.0 + SIZE / np.minimum(hits.t, 100.0)) / cosine
        # Of the cone in which a sphere is seen float32 has 1 - cos, which is 1 / (2 pi density).
        bound += np.where(hits.shape == 0, 8.0 * UNIT_ROUNDOFF * 2.0 * np.pi * own**2, 0.0)
        wrong = np.abs(own - theirs) > bound
        assert {0, 1, 2} & set(hits.shape[lit & hits.hit & (ours > 0)])
        assert wrong.mean() < 0.002  # outlines, within float32


# ---- radiance ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def lit() -> tuple[Scene, Counterpart]:
    scene = Scene.parse(LIT)
    return scene, counterpart_of(scene)


@pytest.mark.parametrize("integrator", [PathTracing(max_depth=4), Direct()], ids=["path", "direct"])
def test_radiance_along_rays(lit: tuple[Scene, Counterpart], integrator: Any) -> None:
    """Means of `integrator.sample` along the same rays."""
    mi = mitsuba()
    scene, counterpart = lit
    o, d = chords(60, 9)
    spp = 256
    ours = scene.radiance(o, d, spp=spp, integrator=integrator)
    kind = {"path": {"max_depth": 4, "rr_depth": 100}, "direct": {}}[integrator.type]
    theirs = mi.load_dict({"type": integrator.type, **kind})
    sampler = mi.load_dict({"type": "independent", "sample_count": 1})
    if mi.variant().startswith("scalar"):
        pytest.skip("fifteen thousand paths, one at a time")
    sampler.seed(1, len(o) * spp)

    def sample(origin: Any, direction: Any) -> tuple[Any, ...]:
        ray = mi.RayDifferential3f(mi.Point3f(origin), direction)
        return (theirs.sample(counterpart.mi_scene, sampler, ray)[0],)

    found = for_rays(sample, np.repeat(o, spp, axis=0), np.repeat(d, spp, axis=0))[0]
    found = found.reshape(len(o), spp, 3)
    error = np.hypot(ours.standard_error, found.std(axis=1) / np.sqrt(spp))
    mean = found.mean(axis=1)
    off = np.abs(ours.mean - mean)
    # Rays whose edges float32 sees on the other side apart: none of these.
    assert (off <= 5.0 * error + 64.0 * UNIT_ROUNDOFF * mean).all()
    assert (error > 0.0).mean() > 0.5


def test_whitted_radiance_is_that_of_the_plugin(scene: Scene, counterpart: Counterpart) -> None:

    o, d = chords(300, 10)
    ours = scene.radiance(o, d, integrator=Whitted())
    theirs = PluginTrees(scene, scene.tables, counterpart, Whitted())(Rays(o, d))
    off = np.abs(ours.mean - theirs).max(axis=1)
    # Outlines, and the checks' edges, within float32.
    assert (off <= 1e-4 * np.abs(theirs).max(axis=1) + 1e-6).mean() > 0.98
    assert not ours.standard_error.any()

"""What a scene answers as an oracle, method by method, against Mitsuba's counterpart."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from comparisons.geometry.float32 import ROUNDINGS, UNIT_ROUNDOFF, delta, round32
from comparisons.geometry.frame import OURS
from comparisons.mitsuba.accuracy import accuracy
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.counterpart import Twin, trace
from comparisons.mitsuba.scene import for_rays
from comparisons.mitsuba.translate import load
from comparisons.mitsuba.translate.materials import translate_material
from comparisons.mitsuba.translate.shapes import canonical, tori
from comparisons.mitsuba.translate.textures import Surroundings
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.rays import Rays
from comparisons.rungs.whitted import plugin_radiance
from reference_rt import Direct, Scene, Whitted
from reference_rt import Path as PathTracing
from reference_rt.core.arrays import FloatArray
from reference_rt.materials import AnyMaterial
from reference_rt.rendering.query import Bsdf
from reference_rt.shapes import Primitive
from reference_rt.shapes.csg import Difference
from reference_rt.shapes.instances import Instance

TEXT = """
camera: {type: perspective, eye: [0.3, 1.5, 9], target: [0, 0.5, 0], fov: 40}
film: {width: 24, height: 16}
integrator: {type: path, max_depth: 4}
textures:
  checks: {type: checker, first: [0.8, 0.7, 0.2], second: 0.3, uv: {scale: [6, 4], rotate: 20}}
  image: {type: bitmap, file: colours.png, uv: {scale: 3}}
  numbers: {type: bitmap, file: wide.png, encoding: raw, wrap: mirror, uv: {offset: [0.2, 0.1]}}
  heights: {type: bitmap, file: heights.png, encoding: raw}
  normals: {type: bitmap, file: normals.png, encoding: raw}
materials:
  grey: {type: diffuse, reflectance: 0.6}
  floor: {type: diffuse, reflectance: checks}
  silver: {type: mirror, reflectance: 0.9}
  gold: {type: conductor, eta: [0.14, 0.37, 1.44], k: [3.98, 2.39, 1.6]}
  glass: {type: dielectric, transmittance: [0.9, 1, 0.9]}
  pane: {type: thin_dielectric}
  brushed: {type: rough_conductor, eta: 0.2, k: 3, alpha: [0.1, 0.4]}
  cast: {type: rough_conductor, eta: 0.2, k: 3, distribution: beckmann, alpha: 0.3}
  frosted: {type: rough_dielectric, alpha: 0.3}
  coat: {type: plastic, reflectance: image, nonlinear: true}
  dull: {type: rough_plastic, reflectance: [0.1, 0.3, 0.7], alpha: 0.2}
  car:
    {type: principled, base_colour: image, roughness: numbers, metallic: 0.3, anisotropic: 0.4,
     sheen: 0.4, sheen_tint: 0.5, clearcoat: 0.5, spec_trans: 0.2, spec_tint: 0.3, flatness: 0.2}
  wax: {type: phong, diffuse: 0.1, specular: 0.3, exponent: 20, mirror: 0.1}
  leaf: {type: mask, base: grey, opacity: numbers}
  mix: {type: blend, first: brushed, second: floor, weight: numbers}
  sheet: {type: two_sided, base: dull, back: mix}
  dents: {type: bump, base: floor, height: heights, scale: 0.1}
  tiles: {type: normal_map, base: floor, normals: normals}
  lamp: {type: emissive, radiance: [3, 2, 1], base: grey}
shapes:
  - {type: sphere, radius: 0.5, center: [-3, 2.2, 0], material: lamp}
  - {type: disk, material: lamp,
     transform: [{scale: 0.5}, {rotate: {axis: [1, 0, 0], degrees: 100}}, {translate: [0, 4, 0]}]}
  - {type: triangle, v0: [2, 3, 1], v1: [3, 3, 1], v2: [2.5, 3.5, 0], material: lamp,
     transform: [{matrix: [[1, 0.2, 0, 0], [0, -1, 0.1, 6], [0.1, 0, 1, 0]]}]}
  - {type: rectangle, material: floor,
     transform: [{scale: [6, 5, 1]}, {rotate: {axis: [1, 0, 0], degrees: -90}},
       {translate: [0, -1, 0]}]}
  - {type: box, material: grey,
     transform: [{scale: 0.5}, {matrix: [[-1, 0.3, 0, 0], [0, 1, 0.2, 0], [0.1, 0, 1, 0]]},
       {rotate: {axis: [1, 2, 3], degrees: 50}}, {translate: [1.5, 0.1, 0.5]}]}
  - {type: sphere, radius: 0.8, center: [-1, 0, 0], material: grey}
lights:
  - {type: point, position: [3, 4, 4], intensity: [10, 11, 12]}
  - {type: spot, origin: [-2, 5, 3], target: [0, 0, 0], intensity: 30, cutoff_angle: 35}
  - {type: directional, direction: [1, -3, -1], irradiance: [0.5, 0.6, 0.7]}
  - {type: constant, radiance: [0.2, 0.3, 0.4]}
"""

SIZE = 6.0
"""No shape reaches further from its own centre."""


@pytest.fixture(scope="module")
def scene(image_folder: Path) -> Scene:
    return Scene.parse(TEXT, folder=image_folder)


@pytest.fixture(scope="module")
def twin(scene: Scene) -> Twin:
    return load(scene, OURS)


def chords(n: int, seed: int) -> tuple[FloatArray, FloatArray]:
    """Rays that float32 can hold, from around the scene through it."""
    rng = np.random.default_rng(seed)
    o, to = rng.normal(size=(2, n, 3))
    o = round32(8.0 * o / np.linalg.norm(o, axis=1, keepdims=True))
    d = 1.5 * to - o
    return o, round32(d / np.linalg.norm(d, axis=1, keepdims=True))


# ---- rays -------------------------------------------------------------------------------------


def test_intersect_and_its_limits(scene: Scene, twin: Twin) -> None:
    """Hits of `ray_intersect` beyond t_min: of rays that Mitsuba starts there."""
    o, d = chords(4000, 1)
    for start in (0.0, 7.0):
        ours, theirs = scene.intersect(o, d, t_min=start), trace(twin, o + start * d, d)
        same = ours.shape == theirs.shape
        # Others pass an outline, or the place where Mitsuba's ray was put, within float32.
        assert same.mean() > 0.998
        met = same & ours.hit
        off = np.abs(ours.t[met] - start - theirs.t[met])
        cosine = np.abs(np.sum(ours.n * d, axis=1))[met]
        bound = delta(o[met], ours.p[met], np.full(met.sum(), SIZE))
        assert (off <= 2.0 * bound / cosine).all()
        assert np.array_equal(ours.hit, scene.first_hits(o, d, t_min=start).hit)


def test_occluded_is_ray_test(scene: Scene, twin: Twin) -> None:
    mi = mitsuba()
    o, d = chords(4000, 2)
    ends = np.random.default_rng(3).uniform(3.0, 12.0, len(o))

    def test(origin: Any, direction: Any, end: Any) -> tuple[Any, ...]:
        ray = mi.Ray3f(mi.Point3f(origin), direction)
        ray.maxt = end
        return (mi.Float(twin.mi_scene.ray_test(ray)),)

    theirs = for_rays(test, o, d, ends)[0] != 0.0
    ours = scene.occluded(o, d, t_max=ends)
    assert 0.2 < ours.mean() < 0.9
    assert (ours == theirs).mean() > 0.998  # outlines, and ends at a surface, within float32


EVERY_SHAPE = """
groups:
  pair: [{type: sphere, radius: 0.8}, {type: sphere, radius: 0.3, center: [0.2, 0.9, 0.1]}]
shapes:
  - {type: sphere, radius: 0.8, center: [-2.4, -2.4, 0]}
  - {type: sphere, radius: 0.8, transform: [SHEARED, {translate: [0, -2.4, 0]}]}
  - {type: box, transform: [{scale: 0.7}, MIRRORED, {translate: [2.4, -2.4, 0]}]}
  - {type: rectangle, transform: [TURNED, {translate: [-2.4, 0, 0]}]}
  - {type: disk, transform: [SHEARED, {translate: [0, 0, 0]}]}
  - {type: plane, transform: [{translate: [0, 0, -3]}]}
  - {type: triangle, v0: [-1, -1, 0], v1: [1, -1, 0.3], v2: [0, 1, 0],
     transform: [MIRRORED, {translate: [2.4, 0, 0]}]}
  - {type: polygon, rings: [[[0, 1], [0.6, -0.8], [-1, 0.3], [1, 0.3], [-0.6, -0.8]]],
     transform: [MIRRORED, {translate: [-2.4, 2.4, 0]}]}
  - {type: mesh, file: tent.obj, transform: [MIRRORED, {translate: [0, 2.4, 0]}]}
  - {type: cylinder, radius: 0.5, capped: false, transform: [TURNED, {translate: [2.4, 2.4, 0]}]}
  - {type: cone, radius: 0.8, transform: [TURNED, {translate: [-2.4, 0, 2.4]}]}
  - {type: torus, major_radius: 0.7, minor_radius: 0.3, transform: [{translate: [0, 0, 2.4]}]}
  - {type: quadric, coefficients: [1, 1, -1, 0, 0, 0, 0, 0, 0, 0.1],
     lower: [-0.9, -0.8, -0.7], upper: [0.8, 0.9, 1], transform: [{translate: [2.4, 0, 2.4]}]}
  - {type: instance, group: pair, transform: [MIRRORED, {translate: [-2.4, 2.4, 2.4]}]}
  - {type: difference, of: [{type: box, transform: [{scale: 0.7}]}, {type: sphere, radius: 0.9}],
     transform: [{translate: [0, 2.4, 2.4]}]}
"""
"""Every type of shape, turned, sheared or mirrored."""

MAPS = {
    "TURNED": "{rotate: {axis: [1, 2, 3], degrees: 50}}",
    "SHEARED": "{matrix: [[1, 0.3, 0, 0], [0, 1, 0.2, 0], [0.1, 0, 0.8, 0]]}",
    "MIRRORED": "{matrix: [[-1, 0.3, 0, 0], [0, 1, 0.2, 0], [0.1, 0, 0.9, 0]]}",
}

TENT = "v -1 -1 0\nv 1 -1 0\nv 0 1 0\nv 0 0 1\nf 1 2 4\nf 2 3 4\nf 3 1 4\nf 3 2 1\n"


@pytest.fixture(scope="module")
def shapes(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    folder = tmp_path_factory.mktemp("shapes")
    (folder / "tent.obj").write_text(TENT)
    text = EVERY_SHAPE
    for name, steps in MAPS.items():
        text = text.replace(name, steps)
    return Scene.parse(text, folder=folder)


def test_every_type_of_shape_is_compared(shapes: Scene) -> None:
    found = {type(shape) for shape in shapes.shapes}
    assert found == {*Primitive.__args__, Instance, Difference}  # of set operations one


def test_crossings_are_repeated_ray_intersections(
    shapes: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of rays whose crossings are so far apart that Mitsuba can leave each without passing two."""
    monkeypatch.setattr(tori, "CELLS", (512, 256))  # meshes that take less time to make
    monkeypatch.setattr(canonical, "CURVED", (512, 256))
    twin = load(shapes, OURS)
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
        theirs = trace(twin, o + t[:, None] * d, d)
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


# ---- materials --------------------------------------------------------------------------------

PAIRS = 200

SMOOTH = ("silver", "gold", "glass", "pane")
"""Perfectly smooth: there is nothing to evaluate."""

MATERIALS = (
    "grey", "floor", "brushed", "cast", "frosted", "coat", "dull", "car", "wax", "leaf", "mix",
    "sheet", "dents", "tiles", "lamp",
)  # fmt: skip

SAME_DENSITY = ("grey", "floor", "brushed", "frosted", "leaf", "lamp", "dents", "tiles")
"""Those that draw directions as Mitsuba does.  The others choose their lobes, or blend, by other
shares, and Mitsuba's Beckmann normals here are not drawn from the visible ones: see
`translate.materials`."""


def test_every_material_is_compared() -> None:
    scene = Scene.parse(TEXT)
    assert {*SMOOTH, *MATERIALS} == set(scene.materials)
    kinds = {material.type for material in scene.materials.values()}
    union = AnyMaterial.__origin__  # type: ignore[attr-defined]
    known = {kind.model_fields["type"].default for kind in union.__args__}
    assert kinds == known


class TheirBsdf:
    """Mitsuba's BSDF of a material, at a point whose shading frame is the world's."""

    def __init__(self, scene: Scene, name: str) -> None:
        around = Surroundings.of(scene)
        self.bsdf = mitsuba().load_dict(translate_material(scene.materials[name], around))

    def place(self, wo: Any, u: Any, v: Any) -> Any:
        import drjit as dr

        mi = mitsuba()
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.t, si.wi, si.uv = 1.0, wo, mi.Point2f(u, v)
        si.n, si.dp_du, si.dp_dv = mi.Normal3f(0, 0, 1), mi.Vector3f(1, 0, 0), mi.Vector3f(0, 1, 0)
        si.sh_frame = mi.Frame3f(mi.Vector3f(1, 0, 0), mi.Vector3f(0, 1, 0), mi.Vector3f(0, 0, 1))
        return si

    def values(self, wo: FloatArray, wi: FloatArray, uv: FloatArray) -> tuple[Any, ...]:
        context = mitsuba().BSDFContext()

        def ask(o: Any, i: Any, u: Any, v: Any) -> tuple[Any, ...]:
            si = self.place(o, u, v)
            return self.bsdf.eval(context, si, i), self.bsdf.pdf(context, si, i)

        return for_rays(ask, wo, wi, uv[:, 0], uv[:, 1])

    def samples(self, wo: FloatArray, u: FloatArray, uv: FloatArray) -> tuple[Any, ...]:
        mi = mitsuba()

        def ask(o: Any, u0: Any, u1: Any, u2: Any, s: Any, t: Any) -> tuple[Any, ...]:
            drawn, weight = self.bsdf.sample(
                mi.BSDFContext(), self.place(o, s, t), u0, mi.Point2f(u1, u2)
            )
            return drawn.wo, weight, drawn.pdf

        return for_rays(ask, wo, *u.T, *uv.T)


def pairs(both: bool, seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """wo, wi, half of them near the mirrored direction, and uv, all of which float32 can hold."""
    rng = np.random.default_rng(seed)
    wo, wi = rng.normal(size=(2, PAIRS, 3))
    wo[:, 2] = wo[:, 2] if both else np.abs(wo[:, 2]) + 0.02
    wi[::2] = (wo * [-1.0, -1.0, 1.0] + 0.1 * wi)[::2]
    wo, wi = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (wo, wi))
    return round32(wo), round32(wi), round32(rng.uniform(size=(PAIRS, 2)))


def float32_bounds(
    bsdf: Bsdf, wo: FloatArray, wi: FloatArray, uv: FloatArray, off: float
) -> tuple[FloatArray, FloatArray]:
    """Of value and density: products' roundings, tables' errors, and how far the roundings of
    directions and texture coordinates move ours."""
    value, pdf = bsdf.evaluate(wo, wi, uv), bsdf.pdf(wo, wi, uv)
    bounds = [
        (128.0 * UNIT_ROUNDOFF + off) * np.abs(value).max(axis=1) + 1e-18,
        128.0 * UNIT_ROUNDOFF * pdf + 1e-18,
    ]
    for k, move in enumerate(arbiter.directions(6)):
        step = ROUNDINGS * UNIT_ROUNDOFF * move
        # Texture coordinates are scaled by up to 6 before they are rounded again.
        other = uv + 6.0 * ROUNDINGS * UNIT_ROUNDOFF * np.array([(-1.0) ** k, (-1.0) ** (k // 2)])
        at = wo + step, wi - step, other
        bounds[0] += np.abs(bsdf.evaluate(*at) - value).max(axis=1)
        bounds[1] += np.abs(bsdf.pdf(*at) - pdf)
    return bounds[0], bounds[1]


@pytest.mark.parametrize("name", MATERIALS)
def test_bsdfs_have_the_same_values(scene: Scene, name: str) -> None:
    bsdf, theirs = scene.bsdf(name), TheirBsdf(scene, name)
    wo, wi, uv = pairs(name in ("frosted", "car", "leaf", "sheet"), seed=5)
    value, density = theirs.values(wo, wi, uv)
    bound, pdf_bound = float32_bounds(bsdf, wo, wi, uv, accuracy(scene, name))
    ours = bsdf.evaluate(wo, wi, uv)
    assert (ours.max(axis=1) > 0.0).sum() > PAIRS // 4
    assert (np.abs(ours - value).max(axis=1) <= bound).all()
    if name in SAME_DENSITY:
        assert (np.abs(bsdf.pdf(wo, wi, uv) - density) <= pdf_bound).all()


@pytest.mark.parametrize("name", [*SMOOTH, *MATERIALS])
def test_samples_of_bsdfs_have_the_same_mean(scene: Scene, name: str) -> None:
    """Of weight times the direction's first two moments: by other shares of lobes, the same law."""
    n = 20_000
    rng = np.random.default_rng(6)
    uv = round32(np.tile(rng.uniform(size=(1, 2)), (n, 1)))
    for tilt in (0.3, 0.9):
        wo = round32(np.tile([np.sin(tilt), 0.0, np.cos(tilt)], (n, 1)))
        ours = scene.bsdf(name).sample(wo, rng.uniform(size=(n, 3)), uv)
        wi, weight, pdf = TheirBsdf(scene, name).samples(wo, rng.uniform(size=(n, 3)), uv)
        found = []
        for direction, own in ((ours.wi, ours.weight), (wi, weight * (pdf > 0.0)[:, None])):
            kept = np.where(own.max(axis=1, keepdims=True) > 0.0, direction, 0.0)
            moments = np.concatenate([own, own * kept[:, :1], own * kept[:, 2:]], axis=1)
            found.append((moments.mean(axis=0), moments.var(axis=0) / n))
        (a, a_error), (b, b_error) = found
        # Weights of one lobe are all alike but for roundings; tables are off by their accuracy.
        slack = (256.0 * UNIT_ROUNDOFF + accuracy(scene, name)) * np.abs(a).max()
        assert (np.abs(a - b) <= 5.0 * np.sqrt(a_error + b_error) + slack).all()
        assert a.max() > 0.01


# ---- lights -----------------------------------------------------------------------------------


def reference_point(p: Any) -> Any:
    """What Mitsuba samples lights for."""
    import drjit as dr

    mi = mitsuba()
    it = dr.zeros(mi.SurfaceInteraction3f)
    it.t, it.p, it.n = 1.0, mi.Point3f(p), mi.Normal3f(0.0, 1.0, 0.0)
    it.sh_frame = mi.Frame3f(it.n)
    return it


POINTS = np.array([[0.3, 1.0, 1.0], [-2.0, 1.0, 3.0], [3.5, 0.5, -2.0]])


def test_samples_of_lights_bring_the_same_light(scene: Scene, twin: Twin) -> None:
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
            drawn, weight = twin.mi_scene.sample_emitter_direction(
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


def test_lights_have_the_same_densities(scene: Scene, twin: Twin) -> None:
    """`pdf_emitter_direction` of what rays from a point meet, the choice of the light apart."""
    mi = mitsuba()
    sources = scene.light_sources()
    emitters = len(sources.shape)
    assert emitters == len(twin.mi_scene.emitters()) <= 8  # a few: picked by power alone
    rng = np.random.default_rng(8)
    n = 4000
    for p in POINTS:
        d = rng.normal(size=(n, 3))
        d[: n // 2] = scene.sample_lights(p, rng.uniform(size=(n // 2, 3))).wi
        d = d[np.abs(d).max(axis=1) > 0.0]
        d = round32(d / np.linalg.norm(d, axis=1, keepdims=True))

        def density(o: Any, w: Any) -> tuple[Any, ...]:
            it = reference_point(o)
            si = twin.mi_scene.ray_intersect(mi.Ray3f(it.p, w))
            ds = mi.DirectionSample3f(twin.mi_scene, si, it)
            is_hit = si.emitter(twin.mi_scene) != None  # noqa: E711
            found = twin.mi_scene.pdf_emitter_direction(it, ds, is_hit)
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


LIT = """
integrator: {type: whitted}
textures:
  checks: {type: checker, first: [0.8, 0.7, 0.2], second: [0.1, 0.2, 0.3], uv: {scale: [6, 4]}}
materials:
  grey: {type: diffuse, reflectance: checks}
  silver: {type: mirror, reflectance: 0.9}
  lamp: {type: emissive, radiance: [5, 4, 3], base: grey}
shapes:
  - {type: rectangle, material: grey, transform: [{scale: 3}, {translate: [0, 0, -2]}]}
  - {type: sphere, radius: 0.7, material: silver}
  - {type: rectangle, material: lamp,
     transform: [{rotate: {axis: [0, 1, 0], degrees: 70}}, {translate: [-2.5, 0, 1]}]}
lights:
  - {type: ambient, radiance: 0.1}
  - {type: constant, radiance: [0.1, 0.2, 0.3]}
  - {type: directional, direction: [0, -1, -1], irradiance: [1, 2, 3]}
  - {type: point, position: [2, 3, 3], intensity: [9, 8, 7]}
"""
"""Of the same kinds as the scene of `test_query.py`, whose kernels it shares."""


@pytest.fixture(scope="module")
def lit() -> tuple[Scene, Twin]:
    scene = Scene.parse(LIT)
    return scene, load(scene, OURS)


@pytest.mark.parametrize("integrator", [PathTracing(max_depth=4), Direct()], ids=["path", "direct"])
def test_radiance_along_rays(lit: tuple[Scene, Twin], integrator: Any) -> None:
    """Means of `integrator.sample` along the same rays."""
    mi = mitsuba()
    scene, twin = lit
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
        return (theirs.sample(twin.mi_scene, sampler, ray)[0],)

    found = for_rays(sample, np.repeat(o, spp, axis=0), np.repeat(d, spp, axis=0))[0]
    found = found.reshape(len(o), spp, 3)
    error = np.hypot(ours.standard_error, found.std(axis=1) / np.sqrt(spp))
    mean = found.mean(axis=1)
    off = np.abs(ours.mean - mean)
    # Rays whose edges float32 sees on the other side apart: none of these.
    assert (off <= 5.0 * error + 64.0 * UNIT_ROUNDOFF * mean).all()
    assert (error > 0.0).mean() > 0.5


def test_whitted_radiance_is_that_of_the_plugin(scene: Scene, twin: Twin) -> None:

    o, d = chords(300, 10)
    ours = scene.radiance(o, d, integrator=Whitted())
    theirs = plugin_radiance(scene, scene.tables, twin, Whitted())(Rays(o, d))
    off = np.abs(ours.mean - theirs).max(axis=1)
    # Outlines, and the checks' edges, within float32.
    assert (off <= 1e-4 * np.abs(theirs).max(axis=1) + 1e-6).mean() > 0.98
    assert not ours.standard_error.any()

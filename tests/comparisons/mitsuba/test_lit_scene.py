"""Light on CSG solids: Mitsuba's hits of the operands, combined while an integrator runs."""

from functools import partial
from typing import Any

import numpy as np
import pytest
from counterparts import coarse_meshes

from comparisons.mitsuba.backend import mitsuba, scalar
from comparisons.mitsuba.counterpart import Counterpart, trace
from comparisons.mitsuba.lit_scene import LitScene
from comparisons.mitsuba.scene import for_rays, render
from comparisons.mitsuba.translate import load
from comparisons.rungs import direct, whitted
from reference_rt.rendering.render import render as render_ours
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables

BALL = "{type: sphere, radius: 0.8, center: [0.3, 0.2, 0.1]}"
BOX = "{type: box, transform: [{scale: 0.7}, {rotate: {axis: [1, 2, 3], degrees: 30}}]}"
FLAT = "{type: sphere, transform: [{scale: [1, 0.6, 0.8]}, {translate: [0.2, 0, 0]}]}"
ROD = "{type: cylinder, radius: 0.3, z_min: -2, z_max: 2}"
HALF = "{type: plane, transform: [{rotate: {axis: [1, 1, 0], degrees: 20}}]}"
RING = "{type: torus, major_radius: 0.7, minor_radius: 0.3}"
MAPS = (
    "",
    "{matrix: [[1, 0.3, 0, 0], [0, 1, 0.2, 0], [0.1, 0, 0.8, 0.1]]}",
    "{matrix: [[-1, 0.3, 0, 0], [0, 1, 0.2, 0], [0.1, 0, 0.9, -0.1]]}",
)
SOLIDS = (
    ("union", (BALL, BOX)),
    ("intersection", (BALL, FLAT)),
    ("difference", (BOX, BALL, ROD)),
    ("difference", (BOX, BOX)),
)
NESTED = (
    ("intersection", (BALL, HALF, f"{{type: union, of: [{BOX}, {RING}]}}")),
    ("difference", (f"{{type: union, of: [{BOX}, {ROD}]}}",
                    f"{{type: difference, of: [{BALL}, {FLAT}]}}")),
)  # fmt: skip


def solid(operation: str, of: tuple[str, ...], map_: str = "", material: str = "") -> str:
    more = f", transform: [{map_}]" if map_ else ""
    more += f", material: {material}" if material else ""
    return f"{{type: {operation}, of: [{', '.join(of)}]{more}}}"


def rays(n: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    o = rng.uniform(-1.5, 1.5, (n, 3))
    d = rng.uniform(-1.0, 1.0, (n, 3)) - o
    d /= np.linalg.norm(d, axis=1)[:, None]
    return o.astype(np.float32).astype(float), d.astype(np.float32).astype(float)


def check_hits(text: str, n: int) -> None:
    """The first hits are those of the counterpart of the geometry rung, which sorts the crossings
    of each ray in NumPy; a ray that meets anything is not free; wi is the ray, in the frame."""
    floor = "{type: rectangle, transform: [{scale: 2}, {translate: [0, 0, -1]}]}"
    counterpart = load(Scene.parse(f"shapes:\n  - {text}\n  - {floor}\n"))
    o, d = rays(n)
    expected = trace(counterpart, o, d)

    def hit(origin: Any, direction: Any) -> tuple[Any, ...]:
        mi = mitsuba()
        si = counterpart.lit.ray_intersect(mi.Ray3f(mi.Point3f(origin), direction))
        free = mi.Ray3f(mi.Point3f(origin), direction)
        free.maxt = si.t * 0.999
        blocked = counterpart.lit.ray_test(mi.Ray3f(mi.Point3f(origin), direction))
        before = counterpart.lit.ray_test(free)
        return si.is_valid(), si.p, si.n, si.to_world(si.wi), blocked, before & si.is_valid()

    met, p, normal, back, blocked, before = for_rays(hit, o, d)
    met = met.astype(bool)
    assert 0.3 * n < met.sum()
    assert (met == (expected.shape >= 0)).all()
    assert (blocked.astype(bool) == met).all()
    assert before.sum() <= 1e-3 * n  # grazing the solid at the very point
    np.testing.assert_allclose(p[met], expected.p[met], atol=3e-6)
    np.testing.assert_allclose(normal[met], expected.n[met], atol=1e-5)
    np.testing.assert_allclose(back[met], -d[met], atol=1e-6)


@pytest.mark.parametrize("map_", MAPS)
@pytest.mark.parametrize(("operation", "of"), SOLIDS)
def test_first_hits(operation: str, of: tuple[str, ...], map_: str) -> None:
    check_hits(solid(operation, of, map_), 4000)


@pytest.mark.slow
@pytest.mark.parametrize("map_", MAPS)
@pytest.mark.parametrize(("operation", "of"), NESTED)
def test_first_hits_of_nested_solids(operation: str, of: tuple[str, ...], map_: str) -> None:
    with coarse_meshes(256, 128):
        check_hits(solid(operation, of, map_), 4000)


@pytest.mark.parametrize(("operation", "of"), SOLIDS)
def test_first_hits_in_the_scalar_variant(operation: str, of: tuple[str, ...]) -> None:
    with scalar():
        check_hits(solid(operation, of, MAPS[1]), 100)


SCENE = """
camera: {type: perspective, eye: [0.5, 2.2, 5], target: [0, 0, 0], fov: 40}
film: {width: 24, height: 16}
sampler: {type: sobol, spp: 64}
integrator: {type: path, max_depth: 6}
materials:
  grey: {type: diffuse, reflectance: 0.6}
  coat: {type: plastic, reflectance: [0.6, 0.3, 0.2]}
  glass: {type: dielectric, transmittance: [0.9, 1, 0.9]}
  silver: {type: mirror, reflectance: 0.9}
  lamp: {type: emissive, radiance: [8, 7, 6]}
  glow: {type: emissive, radiance: [0.5, 1, 2], base: grey}
shapes:
  - {type: rectangle, material: lamp,
     transform: [{rotate: {axis: [1, 0, 0], degrees: 90}}, {translate: [0, 3, 0]}]}
  - {type: rectangle, material: grey,
     transform: [{scale: 3}, {rotate: {axis: [1, 0, 0], degrees: -90}}, {translate: [0, -1.2, 0]}]}
  - SOLID
lights:
  - {type: point, position: [2, 2, 3], intensity: 6}
  - {type: directional, direction: [1, -3, -1], irradiance: 0.4}
  - {type: constant, radiance: [0.2, 0.25, 0.3]}
"""


def lit(operation: str, of: tuple[str, ...], material: str, map_: str = MAPS[1]) -> Scene:
    return Scene.parse(SCENE.replace("SOLID", solid(operation, of, map_, material)))


OPERATIONS = (("union", (BALL, BOX)), ("intersection", (BALL, FLAT)), ("difference", (BOX, BALL)))


def check_rungs(scene: Scene, counterpart: Counterpart) -> None:
    tables = build_tables(scene)
    rungs = [rung(scene, tables, counterpart, 150) for rung in (direct, whitted)]
    for rung in rungs:
        assert rung.status == "agree" or "no material" in rung.reason, rung.reason


@pytest.mark.parametrize(
    ("operation", "of", "material"),
    [
        pytest.param(*operation, material, marks=() if k == m else pytest.mark.slow)
        for k, operation in enumerate(OPERATIONS)
        for m, material in enumerate(("coat", "glass", "grey", "silver", "glow"))
    ],
)
def test_light_of_each_operation(operation: str, of: tuple[str, ...], material: str) -> None:
    scene = lit(operation, of, material)
    check_rungs(scene, load(scene))


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("radius: 0.8, center: [0.3, 0.2, 0.1]", "radius: 0.8, center: [0.31, 0.2, 0.1]"),
        ("type: difference", "type: union"),
        ("reflectance: [0.6, 0.3, 0.2]", "reflectance: [0.6, 0.31, 0.2]"),
    ],
)
def test_a_planted_fault_is_seen(right: str, wrong: str) -> None:
    text = SCENE.replace("SOLID", solid("difference", (BOX, BALL), MAPS[1], "coat"))
    assert text.count(right) == 1
    scene = Scene.parse(text)
    other = load(Scene.parse(text.replace(right, wrong)))
    assert direct(scene, build_tables(scene), other, 150).status == "differ"


def check_means(a: np.ndarray, b: np.ndarray) -> None:
    """Means of pictures (seeds, h, w, 3), and of their halves; 5.5 standard errors for 15 numbers
    each."""
    for columns in (slice(None), slice(None, a.shape[2] // 2), slice(a.shape[2] // 2, None)):
        x, y = (side[:, :, columns].mean(axis=(1, 2)) for side in (a, b))
        error = np.sqrt(x.var(axis=0, ddof=1) / len(x) + y.var(axis=0, ddof=1) / len(y))
        assert (np.abs(x.mean(axis=0) - y.mean(axis=0)) <= 5.5 * error).all()
        assert (error < 0.02 * x.mean(axis=0)).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    "integrator",
    [
        "{type: path, max_depth: 4}",
        "{type: path}",
        "{type: direct}",
        "{type: direct, light_samples: 0}",
        "{type: direct, bsdf_samples: 0}",
    ],
)
def test_without_solids_the_integrator_is_mitsubas(integrator: str) -> None:
    """Our plugin in a scene that Mitsuba's own integrators render too."""
    text = SCENE.replace("{type: path, max_depth: 6}", integrator)
    ball = "{type: sphere, radius: 0.7, material: glass}"
    plain = load(Scene.parse(text.replace("SOLID", ball)))
    with_one = load(Scene.parse(text.replace("SOLID", solid("union", (ball,)))))
    mi_integrator = with_one.mi_scene.integrator()
    mi_integrator.lit = partial(LitScene, solids=())
    theirs = render(plain.mi_scene, 8, 64).pictures
    mi = mitsuba()
    ours = [
        np.array(mi.render(plain.mi_scene, integrator=mi_integrator, spp=64, seed=100 + k))
        for k in range(8)
    ]
    check_means(np.stack(ours)[..., :3], theirs)


@pytest.mark.parametrize(
    ("operation", "material"),
    [
        ("difference", "coat"),
        pytest.param("intersection", "glass", marks=pytest.mark.slow),
        pytest.param("union", "glow", marks=pytest.mark.slow),
    ],
)
def test_pictures(operation: str, material: str) -> None:
    scene = lit(operation, (BOX, BALL), material)
    theirs = render(load(scene).mi_scene, 8, 64).pictures
    ours = [
        render_ours(
            scene.changed(sampler=scene.resolved_sampler.model_copy(update={"seed": k})),
            tables=scene.tables,
            threads=1,
        ).colour
        for k in range(8)
    ]
    check_means(np.stack(ours), theirs)


def test_scalar_variants_take_too_long() -> None:
    scene = lit("union", (BOX, BALL), "grey")
    assert load(scene).no_pictures_reason == ""
    with scalar():
        counterpart = load(scene)
        assert "llvm_ad_rgb" in counterpart.no_pictures_reason
        assert counterpart.no_light_reason == ""


@pytest.mark.slow
def test_pictures_are_made_in_parts_of_few_rays() -> None:
    """The mean of parts with seeds of their own."""
    mi_scene = load(lit("union", (BOX, BALL), "grey")).mi_scene
    whole = render(mi_scene, 8, 32).pictures
    mi_scene.integrator().most_rays = 24 * 16 * 12  # 12, 12 and 8 samples
    parts = render(mi_scene, 8, 32, seed=50).pictures
    assert len({picture.tobytes() for picture in parts}) == 8
    check_means(whole, parts)
    np.testing.assert_allclose(parts.var(axis=0).mean(), whole.var(axis=0).mean(), rtol=0.3)

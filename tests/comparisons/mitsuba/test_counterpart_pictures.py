"""Pictures of counterparts in Mitsuba have our means: of replicates, in six blocks of the picture.

Lamps of every kind; CSG solids, hidden lamps and partly opaque masks, for which an integrator of
ours runs in Mitsuba; and its hits of solids.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from counterparts import COATS, coarse_meshes, coated

import comparisons.compare.compare
import reference_rt as rt
from comparisons.compare.budget import Budget
from comparisons.compare.compare import Subject, compare_scene
from comparisons.mitsuba.backend import mitsuba, scalar
from comparisons.mitsuba.counterpart import Counterpart, trace
from comparisons.mitsuba.lit_scene import LitScene
from comparisons.mitsuba.scene import for_rays, render
from comparisons.rungs import direct, whitted
from comparisons.translator import UntranslatableError, load, to_mitsuba
from comparisons.translator.notes import notes_of
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.scene import Scene

SEEDS = 8


def by_ours(scene: Scene) -> FloatArray:
    samplers = [scene.resolved_sampler.model_copy(update={"seed": k}) for k in range(SEEDS)]
    return np.stack([rt.render(scene.changed(sampler=s)).colour for s in samplers])


def by_mitsuba(mi_scene: Any, scene: Scene) -> FloatArray:
    return render(mi_scene, SEEDS, scene.resolved_sampler.spp).pictures


def means(pictures: FloatArray) -> FloatArray:
    """(seeds, 9): of the channels, and of six blocks of the grey picture."""
    k, h, w, _ = pictures.shape
    blocks = pictures.reshape(k, 2, h // 2, 3, w // 3, 3).mean(axis=(2, 4, 5)).reshape(k, 6)
    return np.column_stack([pictures.mean(axis=(1, 2)), blocks])


def agree(a: FloatArray, b: FloatArray, power: float) -> bool:
    """Whether all means are within 6 standard errors, estimated from 16 pictures: a right one of
    the nine exceeds that once in 10,000 times (Student's t of 14 degrees).  Pictures are as large
    and as exact as `power` asks."""
    sides = [means(side) for side in (a, b)]
    error = np.sqrt(sum(side.var(axis=0, ddof=1) for side in sides) / SEEDS)
    middle = sides[0].mean(axis=0)
    assert middle[:3].min() > 0.002
    assert (error[:3] < power * middle[:3]).all()
    return bool((np.abs(middle - sides[1].mean(axis=0)) <= 6.0 * error + 1e-4 * middle).all())


# ---- scenes -------------------------------------------------------------------------------------

CORNERS = {
    "whole": [[0, 0], [1, 0], [1, 1], [0, 1]],
    "a part": [[0.1, 0.1], [0.3, 0.1], [0.3, 0.4], [0.1, 0.4]],
    "one place": [[0.3, 0.6]] * 4,
    "repeated": [[0, 0], [3, 0], [3, 2], [0, 2]],
}
CHECKER = rt.Checker(first=9.0, second=(1.0, 0.5, 0.2), uv={"offset": (0.13, 0.21)})
"""Shifted: middles of faces, which Whitted ray tracing takes, are on no edge of its squares."""
BENT = {"matrix": ((0.8, 0.3, 0, 0), (0, 0.5, 0.2, 1.7), (0.1, 0, 0.9, 0))}
MIRRORED = {"matrix": ((-0.8, 0.3, 0, 0.5), (0, 0.5, 0.2, 1.7), (0.1, 0, 0.9, 0))}


def quads(uv: str = "", **columns: Any) -> rt.Mesh:
    """Two quads, turned down;  uv: of `CORNERS`."""
    x = np.array([[-1.0, 2.0, -1.0], [1.0, 2.0, -1.0], [1.0, 2.2, 1.0], [-1.0, 2.2, 1.0]])
    vertices = np.concatenate([0.5 * x, 0.3 * x + [1.5, 0.5, 0.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    if uv:
        columns["uv"] = np.array(CORNERS[uv] * 2, np.float64)
    return rt.Mesh(vertices=vertices, faces=faces, material="lamp", **columns)


def with_lamps(*shapes: Any, texture: Any = None, **groups: Any) -> Scene:
    """Lamps above a floor."""
    floor = ({"scale": 4}, {"rotate": {"axis": (1, 0, 0), "degrees": -90}})
    return Scene(
        camera=rt.Perspective(eye=(0, 3, 6), target=(0, 0.6, 0), fov=50),
        film=rt.Film(width=24, height=16),
        sampler=rt.Sobol(spp=256),
        integrator=rt.Path(max_depth=3),
        textures={} if texture is None else {"t": texture},
        materials={"lamp": rt.Emissive(radiance="t" if texture else (9, 6, 3))},
        shapes=(rt.Rectangle(transform=floor), *shapes),
        groups=groups,
    )


def instances(*members: Any, texture: Any = None) -> Scene:
    steps = {"scale": (1, 0.9, 1.1)}, {"translate": (0, 0, 1.5)}, {"scale": (-1, 1.1, 1)}
    shapes = [rt.Instance(group="lamps", transform=(step,)) for step in steps]
    return with_lamps(*shapes, texture=texture, lamps=members)


TILTED = np.array([[0.9, -1, 0], [-0.9, -1, 0.2], [0.1, -1, 0.8], [0, 0.4, -1]] * 2)
NORMALS = TILTED / np.linalg.norm(TILTED, axis=1)[:, None]
"""The triangle's normal decides which side shines, and how much reaches a point."""
COLOURS = np.linspace(0.1, 1.0, 24).reshape(8, 3)
BALL = rt.Sphere(material="lamp", radius=0.5, center=(-1.5, 1.5, 0))
SMALL = rt.Box(material="lamp", transform=({"scale": 0.2}, BENT))
SLAB = {"scale": (0.8, 0.5, 0.6)}

LAMPS: dict[str, Callable[[], Scene]] = {
    **{f"uv: {uv}": partial(with_lamps, quads(uv), texture=CHECKER) for uv in ("", *CORNERS)},
    "colours": lambda: with_lamps(quads(colours=COLOURS), texture=rt.VertexColours(scale=9.0)),
    "normals": lambda: with_lamps(quads("a part", normals=NORMALS)),
    "normals and uv": lambda: with_lamps(quads("a part", normals=NORMALS), texture=CHECKER),
    **{
        f"box {k}": partial(
            with_lamps, rt.Box(material="lamp", transform=(SLAB, m)), texture=CHECKER
        )
        for k, m in enumerate((BENT, MIRRORED))
    },
    "instances": lambda: instances(quads("whole"), BALL, SMALL),
    "textured instances": lambda: instances(quads("whole"), texture=CHECKER),
    # Rays that are scattered find them, no light sample does.
    "cone": lambda: with_lamps(rt.Cone(material="lamp", transform=(BENT,)), texture=CHECKER),
    "ellipsoid": lambda: with_lamps(rt.Sphere(material="lamp", radius=0.6, transform=(MIRRORED,))),
    "cylinder": lambda: with_lamps(rt.Cylinder(material="lamp", radius=0.6, transform=(BENT,))),
    "torus": lambda: with_lamps(
        rt.Torus(material="lamp", major_radius=0.7, transform=(MIRRORED,)), texture=CHECKER
    ),
}

PLANE = """
camera: {{type: perspective, eye: [0.5, 1, 4], target: [0, 0, 0], fov: 40}}
film: {{width: 9, height: 6}}
sampler: {{type: independent, spp: 256}}
integrator: {{type: path, max_depth: 3}}
textures: {{half: {{type: checker, first: 0.25, second: 0.75, uv: {{scale: 5}}}}}}
materials:
  mask: {{type: mask, base: both, opacity: {opacity}}}
  both: {{type: two_sided, base: white}}
  white: {{type: diffuse, reflectance: 0.8}}
shapes:
  - {{type: rectangle, material: mask, transform: [{{scale: 9}}]}}
lights:
  - {light}
"""
LIGHTS = {
    "point": "{type: point, position: [2, 3, 4], intensity: 9}",
    "directional": "{type: directional, direction: [0.3, 0.2, -1], irradiance: 2}",
    "constant": "{type: constant, radiance: 0.7}",
}


def mask(opacity: float | str, light: str = "point") -> Scene:
    return Scene.parse(PLANE.format(opacity=opacity, light=LIGHTS[light]))


HIDING = """
camera: {{type: perspective, eye: [0, 0.5, 5], target: [0, 0, 0], fov: 35}}
film: {{width: 12, height: 8}}
sampler: {{type: independent, spp: 256}}
integrator: {{type: {integrator}, hide_emitters: {hides}}}
materials:
  clay: {{type: diffuse, reflectance: [0.7, 0.5, 0.3]}}
  lamp: {{type: emissive, radiance: [9, 7, 5], base: clay}}
shapes:
  - {seen}
  - {lamp}
  - {{type: rectangle, transform: [{{scale: 3}}, {{translate: [0, 0, -2]}}]}}
lights:
  - {{type: constant, radiance: 0.2}}
"""
SEEN = {
    "ball": "{type: sphere, center: [0.1, 0, -0.5], radius: 0.8, material: clay}",
    "crate": "{type: box, transform: [{rotate: {axis: [1, 2, 3], degrees: 35}}], material: clay}",
}
TURN = "{rotate: {axis: [3, 1, 2], degrees: 50}}, {translate: [0.2, 0.4, 1.6]}"
HIDDEN = {
    "sphere": "{type: sphere, radius: 0.4, center: [0.2, 0.4, 1.6], material: lamp}",
    **{
        name: f"{{type: {kind}, transform: [{{scale: {size}}}, {TURN}], material: lamp}}"
        for name, kind, size in (
            ("rectangle", "rectangle", "0.5"),
            ("disk", "disk", "0.5"),
            ("box", "box", "[0.3, 0.2, 0.4]"),
            ("ellipsoid", "sphere", "[0.5, 0.2, 0.3]"),
            ("cylinder", "cylinder", "0.3"),
            ("torus", "torus", "0.4"),
        )
    },
    "solid": "{type: difference, material: lamp, of: [{type: sphere}, {type: sphere, "
    f"center: [0.5, 0, 0]}}], transform: [{{scale: 0.4}}, {TURN}]}}",
    "two": "{type: union, material: lamp, of: [{type: sphere, radius: 0.3, center: [0, 0.4, 1.6]},"
    " {type: sphere, radius: 0.2, center: [0.1, 0.4, 2.4]}]}",
}


def hiding(lamp: str, integrator: str = "path", hides: bool = True, seen: str = "") -> Scene:
    seen = SEEN[seen or ("crate" if lamp == "box" else "ball")]
    values = {"lamp": HIDDEN[lamp], "seen": seen, "integrator": integrator}
    return Scene.parse(HIDING.format(**values, hides=str(hides).lower()))


BALLS = "{type: sphere, radius: 0.8, center: [0.3, 0.2, 0.1]}"
BOX = "{type: box, transform: [{scale: 0.7}, {rotate: {axis: [1, 2, 3], degrees: 30}}]}"
EGG = "{type: sphere, transform: [{scale: [1, 0.6, 0.8]}, {translate: [0.2, 0, 0]}]}"
ROD = "{type: cylinder, radius: 0.3, z_min: -2, z_max: 2}"
HALF = "{type: plane, transform: [{rotate: {axis: [1, 1, 0], degrees: 20}}]}"
RING = "{type: torus, major_radius: 0.7, minor_radius: 0.3}"
MAPS = (
    "",
    "{matrix: [[1, 0.3, 0, 0], [0, 1, 0.2, 0], [0.1, 0, 0.8, 0.1]]}",
    "{matrix: [[-1, 0.3, 0, 0], [0, 1, 0.2, 0], [0.1, 0, 0.9, -0.1]]}",
)
SOLIDS = (
    ("union", (BALLS, BOX)),
    ("intersection", (BALLS, EGG)),
    ("difference", (BOX, BALLS, ROD)),
    ("difference", (BOX, BOX)),
    ("intersection", (BALLS, HALF, f"{{type: union, of: [{BOX}, {RING}]}}")),
    ("difference", (f"{{type: union, of: [{BOX}, {ROD}]}}",
                    f"{{type: difference, of: [{BALLS}, {EGG}]}}")),
)  # fmt: skip
LIT = """
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


def solid(operation: str, of: tuple[str, ...], map_: str = "", material: str = "") -> str:
    more = f", transform: [{map_}]" if map_ else ""
    more += f", material: {material}" if material else ""
    return f"{{type: {operation}, of: [{', '.join(of)}]{more}}}"


def lit(operation: str, material: str) -> Scene:
    of = (BOX, BALLS) if operation == "difference" else (BALLS, BOX)
    return Scene.parse(LIT.replace("SOLID", solid(operation, of, MAPS[1], material)))


# ---- means --------------------------------------------------------------------------------------


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", LAMPS)
def test_lamps(name: str) -> None:
    """Direct light value by value and Whitted ray tracing pixel by pixel, too."""
    scene = LAMPS[name]()
    with coarse_meshes(256, 128):
        counterpart = load(scene)
        for rung in (direct, whitted):
            found = rung(scene, scene.tables, counterpart, 500)
            assert found.status in ("agree", "not-applicable"), found.reason
        theirs = by_mitsuba(counterpart.mi_scene, scene)
    assert agree(by_ours(scene), theirs, 0.03)


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["path", "direct"])
@pytest.mark.parametrize("lamp", HIDDEN)
def test_hidden_lamps(lamp: str, integrator: str) -> None:
    """Mitsuba misplaces what lies behind them, and our integrator takes its place."""
    scene = hiding(lamp, integrator)
    counterpart = load(scene)
    assert counterpart.has_our_integrator
    assert any("misplaces what lies behind hidden lamps" in note for note in notes_of(scene))
    theirs = by_mitsuba(counterpart.mi_scene, scene)
    assert agree(by_ours(scene), theirs, 0.02)
    assert not agree(by_ours(hiding(lamp, integrator, hides=False)), theirs, 0.1)


@pytest.mark.cases(3)
@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("opacity", [0.25, 0.8, "half"])
def test_masks_that_are_partly_opaque(opacity: float | str, light: str) -> None:
    """Mitsuba's path tracer squares their opacity, and our integrator takes its place."""
    scene = mask(opacity, light)
    counterpart = load(scene)
    assert counterpart.has_our_integrator
    assert any("opacity of a mask twice" in note for note in notes_of(scene))
    assert agree(by_ours(scene), by_mitsuba(counterpart.mi_scene, scene), 0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("operation", "material"),
    [("difference", "coat"), ("intersection", "glass"), ("union", "glow")],
)
def test_solids(operation: str, material: str) -> None:
    scene = lit(operation, material)
    assert agree(by_ours(scene), by_mitsuba(load(scene).mi_scene, scene), 0.02)


@pytest.mark.cases(1)
@pytest.mark.parametrize("coat", COATS)
def test_samples_of_plastics_have_the_density_that_they_state(
    coat: str, image_folder: Path
) -> None:
    """Light of the sky on plastics with colours of vertices, which a path finds by samples of the
    material and by samples of the sky, weighted by both densities: a wrong probability of a lobe of
    5 % or more of the light would show."""
    sky = "[{type: constant, radiance: [0.7, 0.6, 0.5]}]"
    scene = Scene.parse(coated(coat, lights=sky), folder=image_folder)
    scene = scene.changed(sampler=rt.Independent(spp=64))
    assert agree(by_ours(scene), by_mitsuba(load(scene).mi_scene, scene), 5e-3)


def test_the_proofs_that_they_are_mitsubas_errors() -> None:
    """Its own is right behind hidden lamps for meshes alone, and `direct` is right of masks."""
    mi = mitsuba()
    for seen, right in (("ball", False), ("crate", True)):
        scene = hiding("sphere", "path", seen=seen)
        own = mi.load_dict(to_mitsuba(scene))
        assert agree(by_ours(scene), by_mitsuba(own, scene), 0.02) == right
    opacity = 0.5
    scenes = [mi.load_dict(to_mitsuba(mask(x))) for x in (opacity, 1.0)]

    def share(integrator: str) -> float:
        used = mi.load_dict({"type": integrator, "max_depth": 2} if integrator == "path" else
                            {"type": integrator})  # fmt: skip
        found = [np.array(mi.render(s, integrator=used, spp=1024)).mean() for s in scenes]
        return float(found[0] / found[1])

    # Of 55,296 paths a share k is reflected: its standard error is at most 0.0022 of 1.
    assert share("direct") == pytest.approx(opacity, rel=0.01)
    assert share("path") == pytest.approx(opacity**2, rel=0.05)


@pytest.mark.parametrize("scene", [hiding("sphere", hides=False), mask(0.0), mask(1.0)])
def test_where_mitsubas_own_is_right_it_stays(scene: Scene) -> None:
    assert not load(scene).has_our_integrator
    notes = " ".join(notes_of(scene))
    assert "hidden lamps" not in notes
    assert "mask twice" not in notes


def test_scalar_variants_take_too_long(monkeypatch: pytest.MonkeyPatch) -> None:
    """Our integrator would trace ray by ray for hours: also where nothing else is compared."""
    assert load(lit("union", "grey")).no_pictures_reason == ""
    budget = Budget(spp=4, replicates=2, pixels=16, light_pixels=16)

    def refused(_: Scene, sampler: str) -> Counterpart:
        raise UntranslatableError("of a test", "scene")

    with scalar():
        counterpart = load(lit("union", "grey"))
        assert "llvm_ad_rgb" in counterpart.no_pictures_reason
        assert counterpart.no_light_reason == ""
        for load_ in (load, refused):
            monkeypatch.setattr(comparisons.compare.compare, "load", load_)
            case = compare_scene(Subject(hiding("sphere")), budget, lambda _: None)
            found = {rung.name: rung for rung in case.rungs}
            if load_ is load:
                assert found["statistics"].status == "not-comparable"
                assert "scalar variant" in found["statistics"].reason


# ---- solids: hits and light ---------------------------------------------------------------------


def check_hits(text: str, n: int) -> None:
    """The first hits are those of the counterpart of the geometry rung, which sorts the crossings
    of each ray in NumPy; a ray that meets anything is not free; wi is the ray, in the frame."""
    floor = "{type: rectangle, transform: [{scale: 2}, {translate: [0, 0, -1]}]}"
    counterpart = load(Scene.parse(f"shapes:\n  - {text}\n  - {floor}\n"))
    rng = np.random.default_rng(1)
    o = rng.uniform(-1.5, 1.5, (n, 3))
    d = rng.uniform(-1.0, 1.0, (n, 3)) - o
    d /= np.linalg.norm(d, axis=1)[:, None]
    o, d = (x.astype(np.float32).astype(float) for x in (o, d))
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


@pytest.mark.cases(1)
@pytest.mark.parametrize("map_", MAPS)
@pytest.mark.parametrize(("operation", "of"), SOLIDS)
def test_first_hits(operation: str, of: tuple[str, ...], map_: str) -> None:
    with coarse_meshes(256, 128):
        check_hits(solid(operation, of, map_), 4000)


@pytest.mark.cases(2)
@pytest.mark.parametrize(("operation", "of"), SOLIDS)
def test_first_hits_in_the_scalar_variant(operation: str, of: tuple[str, ...]) -> None:
    with scalar(), coarse_meshes(64, 32):
        check_hits(solid(operation, of, MAPS[1]), 100)


@pytest.mark.cases(1)
@pytest.mark.parametrize("material", ["coat", "glass", "grey", "silver", "glow"])
@pytest.mark.parametrize("operation", ["union", "intersection", "difference"])
def test_light_on_solids(operation: str, material: str) -> None:
    scene = lit(operation, material)
    with scalar():
        counterpart = load(scene)
        for rung in (direct, whitted):
            found = rung(scene, scene.tables, counterpart, 100)
            assert found.status == "agree" or "no material" in found.reason, found.reason


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("radius: 0.8, center: [0.3, 0.2, 0.1]", "radius: 0.8, center: [0.31, 0.2, 0.1]"),
        ("type: difference", "type: union"),
        ("reflectance: [0.6, 0.3, 0.2]", "reflectance: [0.6, 0.31, 0.2]"),
    ],
)
def test_a_planted_fault_is_seen(right: str, wrong: str) -> None:
    text = LIT.replace("SOLID", solid("difference", (BOX, BALLS), MAPS[1], "coat"))
    assert text.count(right) == 1
    scene = Scene.parse(text)
    with scalar():
        other = load(Scene.parse(text.replace(right, wrong)))
        assert direct(scene, scene.tables, other, 100).status == "differ"


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
    text = LIT.replace("{type: path, max_depth: 6}", integrator)
    ball = "{type: sphere, radius: 0.7, material: glass}"
    plain = load(Scene.parse(text.replace("SOLID", ball)))
    used = load(Scene.parse(text.replace("SOLID", solid("union", (ball,))))).mi_scene.integrator()
    used.lit = partial(LitScene, solids=())
    mi = mitsuba()
    ours = [
        np.array(mi.render(plain.mi_scene, integrator=used, spp=64, seed=100 + k))[..., :3]
        for k in range(SEEDS)
    ]
    assert agree(np.stack(ours), render(plain.mi_scene, SEEDS, 64).pictures, 0.02)


@pytest.mark.slow
def test_pictures_are_made_in_parts_of_few_rays() -> None:
    """The mean of parts with seeds of their own."""
    mi_scene = load(lit("union", "grey")).mi_scene
    whole = render(mi_scene, SEEDS, 32).pictures
    mi_scene.integrator().most_rays = 24 * 16 * 12  # 12, 12 and 8 samples
    parts = render(mi_scene, SEEDS, 32, seed=50).pictures
    assert len({picture.tobytes() for picture in parts}) == SEEDS
    assert agree(whole, parts, 0.02)
    np.testing.assert_allclose(parts.var(axis=0).mean(), whole.var(axis=0).mean(), rtol=0.3)

"""Media and phase functions: to Mitsuba and back, in memory and in files; which way g counts; and
which medium is where."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import reference_rt as rt
from comparisons.integrators import translate_integrator
from comparisons.media import PHASES, translate_medium
from comparisons.media.phases import translate_phase
from comparisons.mitsuba.backend import mitsuba, scalar
from comparisons.referee.sizes import ShapeSizes
from comparisons.rungs.geometry import geometry
from comparisons.rungs.rays import media as along
from comparisons.rungs.sampling.media import density_of
from comparisons.translator import load
from comparisons.translator.reading import read_dict
from comparisons.translator.writing import write_xml
from reference_rt.core.model import types_of
from reference_rt.media import AnyPhase
from reference_rt.rendering.scene import Scene
from reference_rt.scene.examples import examples
from reference_rt.util.errors import SceneWarning

SCENES = Path(__file__).parents[3] / "scenes"

OF_MEDIA = ("fog", "coloured_fog", "milk_glass", "absorbing_glass", "nested_media")
"""Scenes that Mitsuba has without solids and without copies."""

PHASE_EXAMPLES = [*examples(AnyPhase), rt.Isotropic(), rt.Rayleigh()]

TEXT = """
camera: {type: perspective, eye: [0, 0, 5], target: [0, 0, 0], medium: air}
film: {width: 24, height: 18}
integrator: {type: path, max_depth: 7, rr_depth: 3}
materials:
  none: {type: none}
  glass: {type: dielectric}
media:
  air: {type: homogeneous, sigma_t: [0.1, 0.2, 0.3], albedo: [0.9, 0.8, 0.7]}
  blood: {type: homogeneous, sigma_t: [1.7, 20, 5.5], albedo: [0.7, 0.1, 0], scale: 3,
    phase: {type: blend, first: {type: hg, g: -0.4}, second: {type: rayleigh}, weight: 0.25}}
shapes:
  - {type: sphere, material: none, interior: blood, exterior: air}
  - {type: box, material: glass, exterior: air, transform: [{scale: 0.5}, {translate: [2, 0, 0]}]}
  - {type: rectangle, transform: [{translate: [0, 0, -3]}]}
lights:
  - {type: constant, radiance: 1}
"""


def test_every_phase_function_has_a_row():
    assert [one.description for one in PHASES] == [*types_of(AnyPhase)]


@pytest.mark.parametrize("phase", PHASE_EXAMPLES, ids=repr)
def test_a_phase_function_has_the_values_of_mitsubas(phase: Any):
    """Also which way g counts: Mitsuba's `wi` is against the light's way."""
    cosines = np.linspace(-0.99, 0.99, 23)
    with scalar() as mi:
        theirs = mi.load_dict(translate_phase(phase))
        mei = mi.MediumInteraction3f()
        mei.wi = mi.Vector3f(0.0, 0.0, -1.0)  # light travels along +z
        mei.sh_frame = mi.Frame3f(mei.wi)
        context = mi.PhaseFunctionContext(None)
        values = []
        for c in cosines.tolist():
            onward = mi.Vector3f((1.0 - c * c) ** 0.5, 0.0, c)
            value, density = theirs.eval_pdf(context, mei, onward)
            values.append((float(np.array(value).ravel()[0]), density))
    expected = density_of(phase, cosines)
    assert np.allclose(np.array(values).T, expected, rtol=1e-5)  # float32, of terms that cancel


def read_again(scene: Scene, path: Path) -> Scene:
    write_xml(scene, path)
    with warnings.catch_warnings():
        warnings.simplefilter("error", SceneWarning)
        return Scene.load(path)


def test_a_file_keeps_every_bit(tmp_path: Path):
    scene = Scene.parse(TEXT)
    read = read_again(scene, tmp_path / "a.xml")
    found = {name: medium.model_dump() for name, medium in read.media.items()}
    for name, medium in scene.media.items():
        a, b = medium.model_dump(), found[name]
        assert np.multiply(a.pop("sigma_t"), a.pop("scale")).tolist() == (
            np.multiply(b.pop("sigma_t"), b.pop("scale")).tolist()
        )
        assert a == b
    assert read.camera.medium == "air"
    assert [(s.interior, s.exterior) for s in read.shapes] == [
        (s.interior, s.exterior) for s in scene.shapes
    ]
    kinds = [None if s.material is None else read.materials[s.material].type for s in read.shapes]
    assert kinds[:2] == ["none", "dielectric"]
    assert read.integrator.max_depth == 7


def test_paths_end_by_their_length_or_by_a_roulette_that_is_right():
    """Mitsuba's `volpathmis` loses light by roulette: findings/."""
    for depth, plugin in ((None, "volpath"), (9, "volpathmis")):
        found = translate_integrator(rt.Path(max_depth=depth, rr_depth=4), has_media=True)
        assert found is not None
        assert found["type"] == plugin
        assert found["rr_depth"] == 4 if depth is None else found["rr_depth"] > 1 << 20


@pytest.mark.parametrize("name", OF_MEDIA)
def test_scenes_are_written_and_read_to_the_same_ways_through_media(name: str, tmp_path: Path):
    scene = Scene.load(SCENES / f"{name}.yaml")
    read = read_again(scene, tmp_path / "a.xml")
    assert {*read.media} == {*scene.media} or len(read.media) == len(scene.media)
    rng = np.random.default_rng(5)
    d = rng.normal(size=(400, 3))
    d /= np.linalg.norm(d, axis=1)[:, None]
    o = np.broadcast_to(scene.camera.eye, d.shape)
    names, others = [*scene.media][:3], [*read.media][:3]
    order = [others.index(n.replace(" ", "_")) for n in names]
    ours = along.thickness(along.absorbing(scene, names, 0.5), along.Rays(o, d))
    again = along.thickness(along.absorbing(read, others, 0.5), along.Rays(o, d))[:, order]
    capped = [np.minimum(x[:, : len(names)], along.DEEPEST) for x in (ours, again)]
    assert np.allclose(*capped, rtol=1e-9, atol=1e-9)
    assert any(x.any() for x in capped)


def of_mitsuba(integrator: str, **more: Any) -> dict[str, Any]:
    medium = {"type": "homogeneous", "albedo": 0.5, "sigma_t": 2.0, "phase": {"type": "hg"}}
    ball = {"type": "sphere", "bsdf": {"type": "null"}, "interior": medium, **more}
    return {"type": "scene", "integrator": {"type": integrator}, "ball": ball}


def test_defaults_are_mitsubas():
    scene = read_dict(of_mitsuba("volpath"), Scene)
    (medium,) = scene.media.values()
    assert medium == rt.Homogeneous(
        sigma_t=(2.0,) * 3, albedo=(0.5,) * 3, phase=rt.HenyeyGreenstein(g=0.8)
    )
    bare = {"type": "scene", "i": {"type": "volpathmis"}}
    bare["ball"] = {"type": "sphere", "interior": {"type": "homogeneous"}}
    (medium,) = read_dict(bare, Scene).media.values()
    assert medium == rt.Homogeneous(sigma_t=(1.0,) * 3, albedo=(0.75,) * 3)
    with scalar() as mi:
        theirs = mi.traverse(mi.load_dict({"type": "homogeneous"}))
        assert float(theirs["sigma_t.value.value"]) == 1.0
        assert float(theirs["albedo.value.value"]) == 0.75


@pytest.mark.parametrize("integrator", ["path", "direct"])
def test_media_are_left_out_where_mitsuba_follows_none(integrator: str):
    with pytest.warns(SceneWarning, match="follows none"):
        scene = read_dict(of_mitsuba(integrator), Scene)
    assert not scene.has_media
    assert [m.type for m in scene.materials.values()] == ["diffuse", "mask"]


def test_one_medium_of_two_shapes_is_read_once():
    medium = {"type": "homogeneous", "id": "fog"}
    scene = {
        "type": "scene", "i": {"type": "volpath"}, "fog": medium,
        "a": {"type": "sphere", "interior": {"type": "ref", "id": "fog"}},
        "b": {"type": "cube", "exterior": {"type": "ref", "id": "fog"}},
        "lamp": {"type": "point", "medium": {"type": "ref", "id": "fog"}},
    }  # fmt: skip
    read = read_dict(scene, Scene)
    assert [*read.media] == ["fog"]
    assert [(s.interior, s.exterior) for s in read.shapes] == [("fog", None), (None, "fog")]


def test_a_colour_above_one_is_written_with_a_scale():
    medium = rt.Homogeneous(sigma_t=(0.3, 7.0, 100.0), albedo=(0.1, 0.2, 0.3), scale=0.7)
    found = translate_medium(medium)
    assert max(found["sigma_t"]["value"]) <= 1.0
    product = np.array(found["sigma_t"]["value"]) * found["scale"]
    assert product.tolist() == (np.array(medium.sigma_t) * 0.7).tolist()
    with scalar() as mi:
        mi.load_dict(found)


# ---- which medium is where -----------------------------------------------------------------------


def wrong_rays(scene: Scene, other: Scene) -> along.Media:
    """The rung's finding where Mitsuba has another scene."""
    counterpart = load(scene)
    sizes = ShapeSizes(scene, counterpart.frame)
    real = along.thickness_in_mitsuba

    def of_other(clear: Scene, counterpart: Any, rays: Any) -> Any:
        names = [*scene.media]
        sigma = max(max(m.sigma_t) for m in clear.media.values())
        return real(along.absorbing(other, names[:3], sigma), counterpart, rays)

    along.thickness_in_mitsuba = of_other
    try:
        return along.media_along(scene, counterpart, sizes, most=300)
    finally:
        along.thickness_in_mitsuba = real


SMALL = {"film": rt.Film(width=24, height=18)}


@pytest.mark.parametrize("name", [*OF_MEDIA, "cloud_of_instances", "csg_smoke"])
def test_the_ways_through_media_agree(name: str):
    scene = Scene.load(SCENES / f"{name}.yaml").changed(**SMALL)
    found = wrong_rays(scene, scene)
    assert found.rays >= 300
    assert not found.too_many, found.first


@pytest.mark.parametrize("turned", [[1, 0, 0], [1, 2, 3]])
@pytest.mark.parametrize(
    "shape",
    [
        "type: rectangle",
        "type: disk",
        "type: polygon, rings: [[[-1, -1], [1, -1], [0, 1]]]",
        "type: triangle, v0: [-1, -1, 0], v1: [1, -1, 0], v2: [0, 1, 0]",
    ],
)
def test_rays_of_a_flat_scene_do_not_lie_in_it(shape: str, turned: list[int]):
    """Rounding would decide which medium they are in."""
    steps = f"[{{rotate: {{axis: {turned}, degrees: -90}}}}, {{translate: [0, 1, 0]}}]"
    scene = Scene.parse(f"""
camera: {{type: pinhole, eye: [-2, 2, -4], target: [0, 0, 0]}}
film: {{width: 4, height: 8}}
shapes:
  - {{{shape}, transform: {steps}, interior: v0}}
media: {{v0: {{type: homogeneous, sigma_t: 1, albedo: 0}}}}
""")
    assert wrong_rays(scene, scene).wrong == 0
    bare = scene.shapes[0].model_copy(update={"interior": None, "exterior": "v0"})
    assert wrong_rays(scene, scene.changed(shapes=(bare,))).too_many


def test_shapes_in_one_place_with_different_media_are_left_out():
    """Which of two sheets in one plane decides is nobody's fault; beside each other they count."""
    text = """
camera: {type: orthographic, eye: [3, 0, 7], target: [0, 0, 0]}
film: {height: 8, width: 4}
shapes:
  - {type: rectangle, transform: [{scale: 0.7}, {translate: [0, 0, Z]}]}
  - {type: rectangle, exterior: v0}
  - {type: sphere}
media: {v0: {type: homogeneous, sigma_t: 1, albedo: 0}}
"""
    for z in (0, 1e-9, 0.1):
        scene = Scene.parse(text.replace("Z", str(z)))
        assert wrong_rays(scene, scene).wrong == 0
        bare = [one.model_copy(update={"exterior": None}) for one in scene.shapes]
        assert wrong_rays(scene, scene.changed(shapes=tuple(bare))).too_many


@pytest.mark.parametrize(
    "shape", ["type: sphere", "type: box", "type: cylinder, z_min: -1", "type: torus"]
)
def test_surfaces_within_the_ray_epsilon_are_beyond_mitsuba(shape: str):
    """It starts behind both, and never leaves the medium; of what is thicker it finds all."""
    text = f"""
camera: {{type: pinhole, target: [0, 0, 0], eye: [4, 3, 5]}}
film: {{width: 24, height: 18}}
shapes:
  - {{{shape}, interior: v0, transform: [{{scale: [1, 1, FLAT]}}]}}
  - {{type: sphere, radius: 0.5, interior: v0, transform: [{{translate: [0, 0, 2]}}]}}
media: {{v0: {{type: homogeneous, sigma_t: 1, albedo: 0}}}}
"""
    for flat, is_limited in ((2e-5, True), (0.1, False)):
        scene = Scene.parse(text.replace("FLAT", str(flat)))
        found = wrong_rays(scene, scene)
        assert not found.too_many, found.first
        assert found.is_limited == is_limited
        bare = scene.shapes[1].model_copy(update={"interior": None})
        assert wrong_rays(scene, scene.changed(shapes=(scene.shapes[0], bare))).too_many
        with scalar():
            rung = geometry(scene, scene.tables, load(scene), 100)
        assert rung.status == ("reference-limited" if is_limited else "agree"), rung.reason


def test_another_medium_inside_is_found():
    scene = Scene.load(SCENES / "nested_media.yaml").changed(**SMALL)
    for k, change in (
        (2, {"interior": "haze"}),
        (2, {"exterior": None}),
        (3, {"exterior": "haze"}),
    ):
        shapes = [*scene.shapes]
        shapes[k] = shapes[k].model_copy(update=change)
        found = wrong_rays(scene, scene.changed(shapes=tuple(shapes)))
        assert found.too_many
        assert "haze: ours" in found.first
    camera = scene.camera.model_copy(update={"medium": "smoke"})
    assert wrong_rays(scene, scene.changed(camera=camera)).too_many


def test_scalar_variants_find_the_same():
    scene = Scene.load(SCENES / "nested_media.yaml").changed(film=rt.Film(width=8, height=6))
    with scalar():
        assert not wrong_rays(scene, scene).too_many
    assert mitsuba() is not None

"""Our integrator for media in Mitsuba, against closed forms."""

from typing import Any

import numpy as np
import pytest
import trimesh

import reference_rt as rt
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.plugins.base import is_wide
from comparisons.mitsuba.scene import picture
from comparisons.translator import load
from comparisons.translator.mistakes import in_place_of, notes_of_integrator
from reference_rt.core.transform import Scale
from reference_rt.rendering.scene import Scene

pytestmark = pytest.mark.skipif(not is_wide(mitsuba()), reason="needs a fast variant")

HEAD = """
camera: {type: orthographic, eye: [0, 0, 5], target: [0, 0, 0], width: 0.2}
film: {width: 8, height: 6}
integrator: {type: path, max_depth: DEPTH}
materials:
  none: {type: none}
  pane: {type: mask, base: black, opacity: 0}
  black: {type: diffuse, reflectance: 0}
  lamp: {type: emissive, radiance: 3}
media:
  ink: {type: homogeneous, sigma_t: [0.5, 1, 2], albedo: 0}
  milk: {type: homogeneous, sigma_t: [0.5, 1, 2], albedo: 1, phase: {type: hg, g: 0.6}}
lights: [{type: constant, radiance: 1}]
shapes:
"""
BITTEN = """
  - type: difference
    material: none
    interior: ink
    of:
      - {type: box}
      - {type: box, transform: [{scale: [0.5, 0.5, 1]}, {translate: [0, 0, 0.75]}]}
"""


def scene_of(shapes: str, depth: int | str = 20) -> Scene:
    return Scene.parse(HEAD.replace("DEPTH", str(depth)) + shapes)


def mean(scene: Scene, spp: int = 64) -> np.ndarray:
    counterpart = load(scene)
    assert counterpart.has_our_integrator
    return np.asarray(picture(counterpart.mi_scene, spp, 3).mean(axis=(0, 1)))


def test_a_solid_absorbs_along_what_is_in_it():
    """A cube from which the half in front of -0.25 is cut in the middle: 0.75 is left of 2."""
    expected = np.exp(-0.75 * np.array([0.5, 1.0, 2.0]))
    # Two ways lose two ray epsilons each, at most 2 x 8.9e-5 long: 2 x 4 x 1.8e-4 of blue.
    assert np.allclose(mean(scene_of(BITTEN), 4), expected, rtol=1.5e-3)


def test_a_furnace_stays_one():
    scene = scene_of(BITTEN.replace("ink", "milk"), 500)
    # One sample is 1 on average, with a spread of about as much.
    assert np.allclose(mean(scene, 512), 1.0, atol=5.0 * 1.0 / np.sqrt(48 * 512))


def test_hidden_lamps_do_not_hide_media():
    text = "  - {type: sphere, material: lamp, radius: 0.5, center: [0, 0, 2]}\n" + BITTEN
    scene = scene_of(text)
    integrator = scene.integrator.model_copy(update={"hide_emitters": True})
    scene = scene.changed(integrator=integrator, lights=())
    shown = scene.changed(integrator=scene.integrator.model_copy(update={"hide_emitters": False}))
    assert np.allclose(mean(scene, 4), 0.0)  # black behind what only absorbs
    assert np.allclose(mean(shown, 4), 3.0)


@pytest.mark.parametrize(
    ("shapes", "text"),
    [
        ("  - {type: sphere, material: none, interior: ink}\n", ""),
        ("  - {type: disk, material: pane}\n", "do not count them"),
        (
            "  - {type: sphere, material: none, interior: ink}\n  - {type: disk, material: lamp}\n",
            "behind the lamp",
        ),
    ],
)
def test_it_takes_the_place_of_mitsubas_where_that_is_wrong(shapes: str, text: str):
    scene = scene_of(shapes)
    used = {shape.material: scene.materials[shape.material] for shape in scene.shapes}
    used |= {"black": scene.materials["black"]} if "pane" in used else {}
    scene = scene.changed(materials=used)
    ours: Any = in_place_of(scene)
    assert (ours is not None) == bool(text)
    assert any(text in note for note in notes_of_integrator(scene)) or not text


def test_a_lamp_behind_boundaries_is_not_lost():
    """A disk of light above a floor, behind six sheets: as bright as without any."""
    floor = "  - {type: rectangle, material: grey, transform: [{scale: 9}]}\n"
    lamp = (
        "  - {type: disk, material: lamp, transform: [{rotate: {axis: [1, 0, 0], degrees: 180}},"
        " {translate: [0, 0, 1]}, {scale: [0.3, 0.3, 1]}]}\n"
    )
    sheets = "".join(
        f"  - {{type: rectangle, material: none, transform: [{{translate: [0, 0, {z}]}}]}}\n"
        for z in (0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
    )
    means = []
    for shapes in (floor + lamp, floor + lamp + sheets):
        text = HEAD.replace("DEPTH", "2").replace("lights: [{type: constant, radiance: 1}]\n", "")
        camera = rt.Orthographic(eye=(0.6, 0.0, 0.1), target=(0.6, 0.0, 0.0), width=0.02)
        scene = Scene.parse(text.replace("  none:", "  grey: {type: diffuse}\n  none:") + shapes)
        means.append(mean(scene.changed(camera=camera), 256))
    assert np.allclose(means[1], means[0], rtol=0.02)  # 12,288 samples, of a spread below 1
    assert means[0].min() > 0.01


ENDLESS = {
    "rectangle": "interior: ink, transform: [{scale: 9}]",
    "disk": "interior: ink, transform: [{scale: 9}]",
    "polygon": "interior: ink, rings: [[[-9, -9], [9, -9], [9, 9], [-9, 9]]]",
    "cylinder": "interior: ink, capped: false",
    "sphere": "exterior: ink, radius: 9",
    "mesh": "exterior: ink, file: ball.obj, transform: [{scale: 9}]",
}
CLOSED = {
    "plane": "interior: ink",
    "sphere": "interior: ink, radius: 9",
    "box": "interior: ink",
    "cylinder": "interior: ink",
    "torus": "interior: ink",
    "mesh": "interior: ink, file: ball.obj",
}


HOLDER = "{type: sphere, material: none, interior: ink, radius: 2, center: [PLACE, 0, 0]}"


@pytest.mark.parametrize(
    ("holder", "around", "endless"),
    [
        ("0", "exterior: ink", False),  # a bubble in a ball of ink
        ("9", "exterior: ink", True),  # and beside one
        ("9", "interior: ink, exterior: ink", True),
        ("9", "interior: ink", False),
        ("0", "interior: ink, exterior: ink", False),
    ],
)
@pytest.mark.parametrize("is_copied", [False, True])
def test_another_shape_may_hold_the_medium(
    holder: str, around: str, endless: bool, is_copied: bool
) -> None:
    """A closed shape that has a medium within does not bound the same medium elsewhere."""
    one = f"{{type: sphere, material: none, radius: 0.5, {around}}}"
    other = HOLDER.replace("PLACE", holder)
    shapes = f"groups: {{two: [{one}, {other}]}}\nshapes: [{{type: instance, group: two}}]"
    if not is_copied:
        shapes = f"shapes: [{one}, {other}]"
    scene = Scene.parse(
        "materials: {none: {type: none}}\nintegrator: {type: path, max_depth: 20}\n"
        "media: {ink: {type: homogeneous, sigma_t: 1.0, albedo: 0.5}}\n"
        f"lights: [{{type: constant, radiance: 1}}]\n{shapes}\n"
    )
    assert (in_place_of(scene) is not None) == endless


@pytest.mark.parametrize("around", ["exterior: ink", "interior: ink, exterior: ink"])
def test_behind_a_plane_a_medium_is_as_dark_as_without_end(around: str) -> None:
    """Mitsuba's own integrator stays: the edge of its scene, the plane's mesh, is far away."""
    scene = Scene.parse(
        "materials: {none: {type: none}}\nintegrator: {type: path, max_depth: 20}\n"
        "camera: {type: perspective, eye: [0, 0, 4], target: [0, 0, 0], fov: 30}\n"
        "film: {width: 8, height: 6}\n"
        "media: {ink: {type: homogeneous, sigma_t: 1.0, albedo: 0.5}}\n"
        "lights: [{type: directional, direction: [0, 0, 1], irradiance: 1}]\n"
        "shapes: [{type: plane, material: none, interior: ink},\n"
        f"  {{type: sphere, material: none, center: [0, 0, -3], {around}}}]\n"
    )
    assert in_place_of(scene) is None
    assert np.all(picture(load(scene).mi_scene, 64, 3) == 0.0)
    assert np.all(rt.render(scene, spp=64).colour == 0.0)


@pytest.mark.parametrize(
    ("shape", "endless"),
    [(shape, True) for shape in ENDLESS.items()] + [(shape, False) for shape in CLOSED.items()],
    ids=lambda value: value[0] if isinstance(value, tuple) else str(value),
)
def test_a_medium_without_end_is_not_lit_by_a_sky(shape: tuple[str, str], endless: bool, tmp_path):
    """Mitsuba lights it as if it ended at the edge of the scene, so that our integrator follows the
    light: none is left on an endless way."""
    kind, fields = shape
    trimesh.creation.icosphere(1).export(tmp_path / "ball.obj")
    head = HEAD.replace("DEPTH", "20").replace("width: 0.2", "width: 0.02")
    text = f"{head}  - {{type: {kind}, material: none, {fields}}}\n"
    (tmp_path / "scene.yaml").write_text(text)
    scene = Scene.load(tmp_path / "scene.yaml")
    scene = scene.changed(materials={"none": scene.materials["none"]})
    assert (in_place_of(scene) is not None) == endless
    if endless and kind != "cylinder":  # whose open ends the view does not meet
        assert np.all(mean(scene, 4) == 0.0)
    if kind == "plane":
        assert np.all(picture(load(scene).mi_scene, 4, 3) == 0.0)
    if kind == "rectangle":  # the edge of a large scene is as dark as none
        large = scene.shapes[0].model_copy(update={"transform": (Scale(scale=1e4),)})
        large = scene.changed(shapes=(large,))
        assert in_place_of(large) is None
        assert np.all(picture(load(large).mi_scene, 4, 3) == 0.0)
        small = rt.Instance(group="sheets", transform=(Scale(scale=1e-4),))
        assert in_place_of(large.changed(shapes=(small,), groups={"sheets": large.shapes}))
    dark = scene.changed(lights=(rt.Point(position=(0, 0, 3), intensity=1.0),))
    assert in_place_of(dark) is None  # its light comes from within a finite distance


@pytest.mark.parametrize("kind", ["orthographic", "perspective", "pinhole", "thin_lens"])
def test_what_is_beyond_the_far_plane_is_not_seen_through_a_boundary(kind: str):
    """Mitsuba's own integrators see it.  Before the far plane ink has its share of the sky."""
    lens = ", aperture_radius: 0.01, focus_distance: 4" if kind == "thin_lens" else ""
    sizes = {"orthographic": "width: 0.02", "pinhole": "film_width: 0.02, film_distance: 1"}
    size = sizes.get(kind, "fov: 2")
    camera = f"{{type: {kind}, eye: [0, 0, 5], target: [0, 0, 0], {size}, far: 4{lens}}}"
    text = HEAD.replace("DEPTH", "20")
    text = text.replace(
        "{type: orthographic, eye: [0, 0, 5], target: [0, 0, 0], width: 0.2}", camera
    )
    place = "transform: [{translate: [0, 0, 2]}]"
    sheet = f"  - {{type: rectangle, material: none, interior: ink, {place}}}\n"
    lamp = "  - {type: disk, material: lamp}\n"
    scene = Scene.parse(text + sheet + lamp)
    # 1 of ink, from z = 2 to the far plane at z = 1, and the sky behind it.
    expected = np.exp(-np.array([0.5, 1.0, 2.0]))
    assert np.allclose(mean(scene, 4), expected, rtol=1e-3)
    ours = rt.render(scene.changed(sampler=rt.Independent(spp=4))).colour
    assert np.allclose(ours, expected, rtol=1e-3)
    assert any("far clipping" in note for note in notes_of_integrator(scene))

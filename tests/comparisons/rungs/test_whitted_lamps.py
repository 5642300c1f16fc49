"""Lamps of Whitted's ray tracing: on surfaces, and with textures that mirrors show."""

from pathlib import Path

import numpy as np
import pytest
from builders import SCENES
from PIL import Image

from comparisons.mitsuba.backend import mitsuba, scalar
from comparisons.rungs import direct, whitted
from comparisons.shapes.stand_ins import coarser
from comparisons.translator import load
from reference_rt.core.transform import rotate
from reference_rt.rendering.scene import Scene

ROOM = """
camera: {{type: perspective, eye: {eye}, target: {target}, up: [0.2, 0.9, 0.1], fov: 60}}
film: {{width: 16, height: 16}}
integrator: {{type: whitted}}
materials: {{mirror: {{type: plastic, interior_ior: 1.8, reflectance: 0.4}}}}
shapes:
  - {{type: rectangle, material: mirror, transform: [{{scale: 4}}, {turn}]}}
  - {{{ceiling}, transform: [{{translate: [0, 0, 2]}}, {turn}]}}
lights: [{{type: {light}: {lamp}, intensity: 1}}]
"""
CEILINGS = {
    "rectangle": "type: rectangle",
    "plane": "type: plane",
    "disk": "type: disk",
    "triangle": "type: triangle, v0: [-3, -3, 0], v1: [4, -3, 0], v2: [0, 4, 0]",
    "polygon": "type: polygon, rings: [[[-2, -2], [3, -2], [2, 3], [-2, 1]]]",
    "solid": "type: difference, of: [{type: box, transform: [{translate: [0, 0, 1]}]},"
    " {type: sphere, radius: 0.2, transform: [{translate: [0.8, 0.8, 2]}]}]",
}


@pytest.mark.slow
@pytest.mark.parametrize("light", ["point, position", "spot, cutoff_angle: 80, target: {}, origin"])
@pytest.mark.parametrize("ceiling", CEILINGS)
def test_lamps_on_a_ceiling(ceiling: str, light: str) -> None:
    """It does not hide them in either renderer; a ceiling that Mitsuba has a hand's breadth lower
    does."""
    turn = rotate((0.3, -0.5, 0.8), 77.7)[:, :3]
    places = [[0.0, 0.0, 1.5], [0.1, 0.0, 0.0], [0.1, 0.2, 2.0]]
    eye, target, lamp = ((turn @ np.array(place)).tolist() for place in places)
    text = ROOM.format(
        eye=eye,
        target=target,
        lamp=lamp,
        light=light.format(target),
        ceiling=CEILINGS[ceiling],
        turn="{rotate: {axis: [0.3, -0.5, 0.8], degrees: 77.7}}",
    )
    scene, lower = Scene.parse(text), Scene.parse(text.replace("[0, 0, 2]", "[0, 0, 1.9]"))
    with scalar():
        found = whitted(scene, scene.tables, load(scene))
        wrong = whitted(scene, scene.tables, load(lower))
    assert found.status == "agree", found.reason
    assert found.numbers["explained"] == 0
    assert wrong.status == "differ"


BETWEEN = (SCENES / "regressions" / "lamp_between_texels.yaml").read_text(encoding="utf-8")


def test_a_lamp_whose_middle_is_between_texels() -> None:
    """Half of the rays see another texel in Mitsuba, though no edge is near them.  A lamp that is
    brighter than both differs; one that is between them is seen by the rung below."""
    scene = Scene.parse(BETWEEN)
    brighter, darker = (Scene.parse(BETWEEN.replace("0.9", other)) for other in ("1.2", "0.6"))
    with scalar():
        found = whitted(scene, scene.tables, load(scene))
        wrong = whitted(scene, scene.tables, load(brighter))
        below = [direct(scene, scene.tables, load(one), 48).status for one in (scene, darker)]
    assert found.status == "reference-limited", found.reason
    assert found.numbers["explained"] > 10
    assert wrong.status == "differ"
    assert below == ["agree", "differ"]


SHOWN = """
camera: {{type: perspective, eye: [0, -6, 3], target: [0, 0, 0], up: [0, 0, 1]}}
film: {{width: 16, height: 12}}
integrator: {{type: whitted}}
textures: {{tiles: {{type: bitmap, file: tiles.png, filter: nearest{uv}}}}}
materials:
  lamp: {{type: emissive, radiance: tiles}}
  mirror: {{type: conductor, eta: 0.2, k: 3}}
  coat: {{type: plastic, interior_ior: 1.8}}
shapes:
  - {{type: plane, material: coat, transform: [{{translate: [0, 0, -2]}}]}}
  - {{type: rectangle, material: mirror,
     transform: [{{scale: 6}}, {{rotate: {{axis: [1, 0, 0], degrees: 80}}}},
       {{translate: [0, 5, 0]}}]}}
  - {{type: plane, material: coat,
     transform: [{{rotate: {{axis: [0, 1, 0.2], degrees: 75}}}}, {{translate: [-3, 0, 0]}}]}}
  - {{{lamp}, material: lamp,
     transform: [{{rotate: {{axis: [1, 0.2, 0], degrees: 170}}}}, {{scale: 0.5}}]}}
  - {{{lamp}, material: lamp,
     transform: [{{rotate: {{axis: [1, 0.4, 0], degrees: 150}}}}, {{translate: [2, 1, 1]}}]}}
  - {{{lamp}, material: lamp,
     transform: [{{rotate: {{axis: [1, -0.3, 0.5], degrees: 160}}}}, {{translate: [-1, 2, 1]}}]}}
"""
LAMPS = {
    "rectangle": "type: rectangle",
    "disk": "type: disk",
    "sphere": "type: sphere",
    "box": "type: box",
    "triangle": "type: triangle, v0: [-1, -1, 0], v1: [1, -1, 0], v2: [0, 1, 0]",
    "mesh": "type: mesh, vertices: [[-1, -1, 0], [1, -1, 0], [0, 1, 0]], faces: [[0, 1, 2]],"
    " uv: [[0, 0], [1, 0], [0.5, 1]]",
}


@pytest.mark.slow
@pytest.mark.parametrize("lamp", LAMPS)
def test_edges_of_texels_in_the_middle_of_lamps(lamp: str, tmp_path: Path) -> None:
    """Mitsuba takes another texel at each surface, also at those that mirrors show; light that is a
    twentieth brighter is found."""
    texels = np.random.default_rng(3).integers(20, 255, (8, 8, 3), dtype=np.uint8)
    Image.fromarray(texels).save(tmp_path / "tiles.png")
    text, wrong = (SHOWN.format(uv=uv, lamp=LAMPS[lamp]) for uv in ("", ", scale: 1.05"))
    scene = Scene.parse(text, folder=tmp_path)
    with scalar(), coarser(0.35):
        right = whitted(scene, scene.tables, load(scene))
        faulty = load(Scene.parse(wrong, folder=tmp_path))
        found = whitted(scene, scene.tables, faulty)
    assert right.status in ("agree", "reference-limited"), right.reason
    assert found.status == "differ"


def test_a_mirrored_rectangle_shines_by_a_texture() -> None:
    """Mitsuba samples the light of its own rectangle, if it is flipped, on the back."""
    scene = Scene.parse("""
camera: {type: perspective, eye: [0, -6, 3], target: [0, 0, 0], up: [0, 0, 1]}
film: {width: 16, height: 12}
integrator: {type: whitted}
textures: {tiles: {type: checker, first: 0.9, second: 0.2, uv: {scale: 1.3}}}
materials: {lamp: {type: emissive, radiance: tiles}}
shapes:
  - {type: plane, transform: [{translate: [0, 0, -1]}]}
  - {type: rectangle, material: lamp, transform: [{scale: [-1, 2, 1]},
     {rotate: {axis: [1, 0.2, 0], degrees: 170}}, {translate: [0.5, 0, 1]}]}
""")
    with scalar():
        counterpart, mi = load(scene), mitsuba()
        place = mi.SurfaceInteraction3f()
        place.p = mi.Point3f(0.2, 0.3, -1.0)
        for u in np.random.default_rng(0).random((20, 2)):
            drawn, light = counterpart.mi_scene.sample_emitter_direction(
                place, mi.Point2f(u), False
            )
            assert drawn.pdf > 0.0
            assert max(light) > 0.0
        assert whitted(scene, scene.tables, counterpart).status == "agree"

"""The rung of direct light finds small faults where it allows for Mitsuba's errors."""

import pytest
from builders import SCENES
from counterparts import faulty_counterpart

from comparisons.mitsuba.backend import scalar
from comparisons.mitsuba.translate import load
from comparisons.mitsuba.translate.shapes.stand_ins import coarser
from comparisons.rungs import direct
from reference_rt import Scene

SPOT = """
camera: {type: perspective, eye: [0, 1, 6], target: [0, 0, 0], fov: 60}
film: {width: 48, height: 40}
shapes: [{type: rectangle, transform: [{scale: 6}, {rotate: {axis: [1, 2, 0], degrees: 9}}]}]
lights:
  - {type: spot, origin: [0.2, 0.1, 3], target: [0, 0, 0], intensity: 5, cutoff_angle: 30,
     beam_width: 29.9}
"""

FAULTS = {
    "a wider spot": (SPOT, "cutoff_angle: 30,\n     beam_width: 29.9", "cutoff_angle: 31"),
    "a spot with a wider beam": (SPOT, "beam_width: 29.9", "beam_width: 29"),
    "grain across": ("brushed_cone", "alpha: [0.0583, 0.488]", "alpha: [0.488, 0.0583]"),
    "a bit less grain": ("brushed_cone", "alpha: [0.0583, 0.488]", "alpha: [0.059, 0.488]"),
    "another index": ("critical_rough_glass", "exterior_ior: 1.1", "exterior_ior: 1.1005"),
}


def text_of(source: str) -> str:
    path = SCENES / "regressions" / f"{source}.yaml"
    return source if "\n" in source else path.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", FAULTS)
def test_faults_are_found(name: str) -> None:
    source, right, wrong = FAULTS[name]
    scene = Scene.parse(text_of(source))
    with scalar(), coarser(0.35):
        faulty = faulty_counterpart(text_of(source), right, wrong)
        assert direct(scene, scene.tables, load(scene), 300).status == "agree"
        assert direct(scene, scene.tables, faulty, 300).status == "differ"


def test_light_beyond_the_edge_of_a_spot_is_found() -> None:
    """As bright as ours within our cone, so that only what lies outside of it tells."""
    wide = "cutoff_angle: 40,\n     beam_width: 39.9"
    with scalar():
        faulty = faulty_counterpart(SPOT, "cutoff_angle: 30,\n     beam_width: 29.9", wide)
        scene = Scene.parse(SPOT)
        found = direct(scene, scene.tables, faulty, 300)
    assert found.status == "differ"

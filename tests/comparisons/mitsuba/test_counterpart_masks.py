"""Masks that are partly opaque, under path tracing: Mitsuba's `path` squares their opacity."""

from pathlib import Path

import numpy as np
import pytest

from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.notes import notes_of
from comparisons.mitsuba.plugins.base import is_wide
from comparisons.mitsuba.reading.reference import changes_to, own_scene
from comparisons.mitsuba.scene import picture
from comparisons.mitsuba.translate import load, to_mitsuba
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene

PLANE = """
camera: {{type: perspective, eye: [0.5, 1, 4], target: [0, 0, 0], fov: 40}}
film: {{width: 8, height: 6}}
sampler: {{type: independent, spp: {spp}}}
integrator: {{type: path, max_depth: {depth}}}
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


def plane(opacity: float | str, light: str = "point", depth: int = 2, spp: int = 1024) -> Scene:
    return Scene.parse(PLANE.format(opacity=opacity, light=LIGHTS[light], depth=depth, spp=spp))


def mean_of_ours(scene: Scene) -> float:
    return float(render(scene).colour.mean())


def mean_of_mitsuba(scene: Scene) -> float:
    return float(picture(load(scene).mi_scene, scene.resolved_sampler.spp, 0).mean())


@pytest.mark.parametrize("opacity", [0.25, 0.5, 0.75])
def test_mitsubas_own_path_tracer_squares_the_opacity(opacity: float) -> None:
    """While `direct` does not: the proof that it is the integrator's error."""
    mi = mitsuba()
    own = mi.load_dict(to_mitsuba(plane(opacity)))
    opaque = mi.load_dict(to_mitsuba(plane(1.0)))

    def share(integrator: str) -> float:
        found = [
            np.array(mi.render(s, integrator=mi.load_dict({"type": integrator}), spp=1024)).mean()
            for s in (own, opaque)
        ]
        return float(found[0] / found[1])

    # Of 49,152 paths a share k is reflected: its standard error is at most 0.0023 of 1.
    assert share("direct") == pytest.approx(opacity, rel=0.01)
    assert share("path") == pytest.approx(opacity**2, rel=0.05)


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("opacity", [0.25, 0.8, "half"])
def test_ours_agrees_with_our_path_tracer_in_mitsuba(opacity: float | str, light: str) -> None:
    scene = plane(opacity, light, depth=3)
    assert is_wide(mitsuba())
    ours, theirs = mean_of_ours(scene), mean_of_mitsuba(scene)
    # Each path has between 0 and twice the mean: a standard error of 1/sqrt(49,152) a side at most.
    assert ours == pytest.approx(theirs, rel=5.0 * np.sqrt(2.0 / 49_152.0))
    assert any("opacity of a mask twice" in note for note in notes_of(scene))


@pytest.mark.parametrize("opacity", [0.0, 1.0])
def test_masks_that_hide_all_or_nothing_keep_mitsubas_own(opacity: float) -> None:
    scene = plane(opacity)
    assert not load(scene).has_our_integrator
    assert not any("opacity of a mask twice" in note for note in notes_of(scene))


def test_the_users_own_file_gets_our_path_tracer_and_the_report_says_so(tmp_path: Path) -> None:
    path = tmp_path / "masks.xml"
    path.write_text(
        '<scene version="3.0.0"><integrator type="path">'
        '<integer name="max_depth" value="2"/></integrator>'
        '<sensor type="perspective"><transform name="to_world"><lookat origin="0.5, 1, 4" '
        'target="0, 0, 0" up="0, 1, 0"/></transform><film type="hdrfilm">'
        '<integer name="width" value="8"/><integer name="height" value="6"/></film></sensor>'
        '<shape type="rectangle"><bsdf type="mask"><float name="opacity" value="0.5"/>'
        '<bsdf type="diffuse"/></bsdf></shape>'
        '<emitter type="point"><point name="position" value="2, 3, 4"/></emitter></scene>',
        encoding="utf-8",
    )
    scene = Scene.load(path)
    assert any("opacity of a mask twice" in text for text in changes_to(scene))
    theirs = float(picture(own_scene(scene), 1024, 0).mean())
    assert mean_of_ours(scene) == pytest.approx(theirs, rel=0.03)

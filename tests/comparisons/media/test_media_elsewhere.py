"""Media in pbrt's files and in resolved scenes, and what others say of them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pbrt_reader import written

import reference_rt as rt
from comparisons.gltf import write_gltf
from comparisons.pbrt import write_pbrt
from comparisons.povray.translate import picture as povray_picture
from comparisons.renderers import NoCounterpartError
from comparisons.translator.resolved import write_resolved
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import SceneError

SCENES = Path(__file__).parents[3] / "scenes"


def test_pbrt_has_the_coefficients_and_sides(tmp_path: Path):
    scene = Scene.load(SCENES / "coloured_fog.yaml")
    camera = scene.camera.model_copy(update={"medium": "even"})
    scene = scene.changed(camera=camera, sampler=rt.Independent(spp=4))
    file = written(scene, tmp_path)
    assert file.options["Integrator"][0] == "volpath"
    assert file.options["Integrator"][1]["integer maxdepth"] == [scene.integrator.max_depth - 1]
    assert file.camera_medium == "even"
    assert {*file.media} == {*scene.media}
    for name, medium in scene.media.items():
        params = file.media[name]
        sigma_t, albedo = np.array(medium.sigma_t), np.array(medium.albedo)
        scattered, absorbed = (np.array(params[f"rgb sigma_{k}"]) for k in "sa")
        assert np.allclose(scattered, sigma_t * albedo, rtol=1e-15)
        assert np.allclose(scattered + absorbed, sigma_t, rtol=1e-15)
        assert params["float scale"] == [medium.scale]
        assert params["float g"] == [getattr(medium.phase, "g", 0.0)]
    sides = [shape.media for shape in file.shapes]
    assert [pair for pair in sides if any(pair)] == [("back", ""), ("even", ""), ("forth", "")]
    assert "interface" in [params["string type"][0] for params in file.materials.values()]


def test_pbrt_refuses_other_phase_functions(tmp_path: Path):
    with pytest.raises(SceneError, match="a phase function 'rayleigh'"):
        write_pbrt(Scene.load(SCENES / "nested_media.yaml"), tmp_path / "a.pbrt")


def test_resolved_scenes_have_media_and_sides(tmp_path: Path):
    scene = Scene.load(SCENES / "nested_media.yaml")
    write_resolved(scene, tmp_path / "a.json")
    found: dict[str, Any] = json.loads((tmp_path / "a.json").read_text("utf-8"))
    assert found["media"]["smoke"]["phase"] == {"type": "hg", "g": 0.3}
    sides = [(s.get("interior"), s.get("exterior")) for s in found["shapes"]]
    assert sides == [(s.interior, s.exterior) for s in scene.shapes]
    assert "medium" not in found["camera"]


def test_others_refuse_media(tmp_path: Path):
    scene = Scene.load(SCENES / "absorbing_glass.yaml")
    with pytest.raises(NoCounterpartError, match="media"):
        povray_picture(scene)
    with pytest.raises(SceneError, match="cannot express media"):
        write_gltf(scene, tmp_path / "a.glb")

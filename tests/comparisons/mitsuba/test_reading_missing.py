"""Leaving out of a Mitsuba scene what ours lack, on both sides."""

from pathlib import Path

import numpy as np
import pytest
from mitsuba_dicts import hits_of, theirs_along

from comparisons.suites.keys import files_digest
from comparisons.translator.reference import changes_to, own_scene
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import SceneError, SceneWarning

VOLPATH = '<integrator type="volpath"/>'
SPHERE = '<shape type="sphere"/>'

MISSING = {
    "medium": (
        f'{VOLPATH}<shape type="sphere"><medium name="interior" type="heterogeneous"/></shape>',
        "medium 'heterogeneous': is not supported, and left out on both sides",
    ),
    "phase function": (
        f'{VOLPATH}<shape type="sphere"><medium name="interior" type="homogeneous">'
        '<phase type="tabphase"><string name="values" value="1, 1"/></phase></medium></shape>',
        "phasefunction 'tabphase': is not supported, and left out on both sides",
    ),
    "bsdf": (
        '<shape type="sphere"><bsdf type="hair"/></shape>',
        "bsdf 'hair': is not supported, and replaced by 'diffuse' on both sides",
    ),
    "bsdf in bsdfs": (
        '<shape type="sphere"><bsdf type="mask"><float name="opacity" value="1"/>'
        '<bsdf type="measured">'
        '<string name="filename" value="a.bsdf"/></bsdf></bsdf></shape>',
        "bsdf 'measured': is not supported, and replaced by 'diffuse' on both sides",
    ),
    "texture": (
        '<shape type="sphere"><bsdf type="diffuse"><texture name="reflectance" type="volume">'
        '<volume type="constvolume"/></texture></bsdf></shape>',
        "texture 'volume': is not supported, and left out on both sides",
    ),
    "shape": (
        f'{SPHERE}<shape type="bsplinecurve"><string name="filename" value="a.txt"/></shape>',
        "shape 'bsplinecurve': is not supported, and left out on both sides",
    ),
    "emitter": (
        f'{SPHERE}<emitter type="timedsunsky"/>',
        "emitter 'timedsunsky': is not supported, and left out on both sides",
    ),
    "emitter of a shape": (
        '<shape type="sphere"><emitter type="directionalarea"/></shape>',
        "emitter 'directionalarea': is not supported, and left out on both sides",
    ),
    "integrator": (
        f'{SPHERE}<integrator type="stokes"/>',
        "integrator 'stokes': is not supported, and replaced by 'path' on both sides",
    ),
    "element of a fork": (
        f'<denoiser type="oidn"><integer name="n" value="3"/>\n</denoiser>{SPHERE}<denoiser/>',
        "<denoiser>: is not supported, and left out on both sides",
    ),
    "element in an element": (
        '<shape type="sphere"><tint.of_fork value="3">\n<velocity x="1"/></tint.of_fork></shape>',
        "<tint.of_fork>: is not supported, and left out on both sides",
    ),
    "parameter": (
        '<shape type="sphere"><float name="wobble" value="1"/></shape>',
        "the parameter 'wobble' is not supported, and left out on both sides",
    ),
}


def written(tmp_path: Path, content: str) -> Path:
    path = tmp_path / "scene.xml"
    sensor = (
        '<sensor type="perspective"><transform name="to_world">'
        '<lookat origin="0.5, 1, 4" target="0, 0, 0" up="0, 1, 0"/></transform>'
        '<film type="hdrfilm"><integer name="width" value="8"/>'
        '<integer name="height" value="6"/></film></sensor>'
    )
    light = '<emitter type="point"><point name="position" value="2, 3, 4"/></emitter>'
    path.write_text(f'<scene version="3.0.0">{content}{sensor}{light}</scene>', "utf-8")
    return path


@pytest.mark.parametrize("name", MISSING)
def test_what_is_missing_is_left_out_on_both_sides(name: str, tmp_path: Path) -> None:
    content, said = MISSING[name]
    path = written(tmp_path, content)
    with pytest.raises(SceneError, match="not supported") as caught:
        Scene.load(path)
    with pytest.warns(SceneWarning) as warned:
        scene = Scene.load(path, allow_missing=True)
    texts = [str(warning.message) for warning in warned]
    assert len(texts) == 1
    assert said in texts[0]
    # File, line and column are those of the error.
    assert texts[0].startswith(str(caught.value).partition("'")[0])
    assert changes_to(scene) == texts
    assert scene.changed(film=scene.film).allows_missing
    # Mitsuba loads the changed scene, which has the same shapes and light as ours.
    own = own_scene(scene)
    o, d = scene.camera_rays().origins.reshape(-1, 3), scene.camera_rays().directions.reshape(-1, 3)
    t, *_ = hits_of(own, o, d)
    assert np.isfinite(t).any()
    np.testing.assert_allclose(t, scene.first_hits(o, d).t, rtol=1e-5)
    theirs, error = theirs_along(own, o, d, 256)
    ours = scene.radiance(o, d, spp=256)
    spread = 5.5 * np.hypot(error, ours.standard_error) + 1e-5
    assert (np.abs(theirs - ours.mean) <= spread).all()


def test_a_camera_cannot_be_left_out(tmp_path: Path) -> None:
    path = written(tmp_path, SPHERE)
    path.write_text(path.read_text("utf-8").replace('"perspective"', '"radiancemeter"'), "utf-8")
    with pytest.raises(SceneError, match="radiancemeter"):
        Scene.load(path, allow_missing=True)


def test_what_is_wrong_stays_an_error(tmp_path: Path) -> None:
    path = written(tmp_path, '<shape type="sphere"><float name="radius" value="-1"/></shape>')
    with pytest.raises(SceneError, match="radius"):
        Scene.load(path, allow_missing=True)


def test_cases_with_and_without_it_are_stored_apart(tmp_path: Path) -> None:
    path = written(tmp_path, SPHERE)
    keys = {files_digest(Scene.load(path, allow_missing=allowed)) for allowed in (False, True)}
    assert len(keys) == 2

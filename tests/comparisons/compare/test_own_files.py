"""Scenes of Mitsuba: the reference is the user's own file, so that a wrong reading is seen."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mitsuba_dicts import hits_of, theirs_along
from PIL import Image

from comparisons.compare.budget import Budget
from comparisons.compare.compare import Subject, compare_scene
from comparisons.mitsuba.backend import backend, mitsuba
from comparisons.mitsuba.context import UntranslatableError
from comparisons.mitsuba.parse import file_of
from comparisons.mitsuba.scene import for_rays, picture
from comparisons.results.case import Case
from comparisons.rungs.rays.camera import camera_rays
from comparisons.suites.keys import case_key
from comparisons.suites.suite import Changes
from comparisons.translator.reading import read_file
from comparisons.translator.reference import own_scene
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import SceneWarning

FILM = """<integer name="width" value="64"/><integer name="height" value="48"/>
  <integer name="crop_offset_x" value="16"/><integer name="crop_offset_y" value="12"/>
  <integer name="crop_width" value="32"/><integer name="crop_height" value="24"/>
  <string name="pixel_format" value="luminance"/><rfilter type="mitchell"/>"""

SCENE = """<scene version="3.0.0">
  <default name="grey" value="0.5"/>
  <integrator type="moment"><integrator type="path"><integer name="max_depth" value="3"/>
  </integrator></integrator>
  <sensor type="SENSOR">
    <float name="fov" value="40"/>EXTRA
    <transform name="to_world"><lookat origin="0, 1, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
    <sampler type="multijitter"><integer name="sample_count" value="64"/></sampler>
    <film type="hdrfilm">FILM</film>
  </sensor>
  <shape type="sphere"><bsdf type="diffuse"><float name="reflectance" value="$grey"/></bsdf></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="4"/><rotate x="1" angle="-90"/>
    <translate y="-1"/></transform></shape>
  <emitter type="constant"/>
</scene>
"""

BUDGET = Budget(replicates=8, spp=256, limit=0.01, pixels=64, light_pixels=64)


def scene_of(folder: Path, film: str = FILM, **defaults: str) -> Scene:
    """The scene under a perspective camera."""
    return placed(folder, film, "perspective", "", defaults)


def placed(folder: Path, film: str, sensor: str, extra: str, defaults: Any = None) -> Scene:
    text = SCENE.replace("FILM", film).replace("SENSOR", sensor).replace("EXTRA", extra)
    (folder / "own.xml").write_text(text)
    return read_file(folder / "own.xml", Scene, defaults)


def compared(scene: Scene) -> Case:
    return compare_scene(Subject(scene), BUDGET, lambda _: None, rungs=("statistics",))


@pytest.mark.filterwarnings("ignore:.*its moments are left out")
def test_a_scene_agrees_with_its_own_file(tmp_path):
    scene = scene_of(tmp_path)
    assert file_of(scene) == tmp_path / "own.xml"
    case = compared(scene)
    assert case.verdict == "agree", case.reason
    assert any("own.xml itself, loaded by Mitsuba" in note for note in case.notes)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*its moments are left out")
def test_a_wrong_reading_differs_from_the_file(tmp_path):
    scene = scene_of(tmp_path)
    wrong = scene.changed(materials={"diffuse": {"type": "diffuse", "reflectance": 0.65}})
    assert file_of(wrong) == tmp_path / "own.xml"
    assert compared(wrong).verdict == "differ"


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*its moments are left out")
def test_defaults_are_those_of_the_reading(tmp_path):
    scene = scene_of(tmp_path, grey="0.9")
    assert compared(scene).verdict == "agree"
    dark, bright = (
        picture(own_scene(s), 16, 0).mean() for s in (scene_of(tmp_path, grey="0.1"), scene)
    )
    assert bright > 1.1 * dark


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*its moments are left out")
def test_a_camera_without_a_translation_is_compared_by_its_picture(tmp_path):
    """Our translator has no lens off the axis; the user's file has."""
    extra = '<float name="aperture_radius" value="0.1"/><float name="focus_distance" value="4"/>'
    case = compared(placed(tmp_path, FILM, "thinlens", extra))
    assert case.verdict == "agree", case.reason


MIRRORED = """<scene version="3.0.0">
  <sensor type="perspective"><float name="fov" value="45"/><transform name="to_world">
    <scale x="-1"/><lookat origin="1, 2, 5" target="0.2, 0, 0" up="0.1, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="16"/>
      <integer name="crop_width" value="20"/><integer name="crop_offset_x" value="1"/></film>
  </sensor>
  <bsdf type="twosided" id="b"><bsdf type="diffuse"><texture name="reflectance" type="checkerboard">
    <transform name="to_uv"><scale x="6" y="3"/></transform></texture></bsdf></bsdf>
  <shape type="sphere"><ref id="b"/><transform name="to_world"><rotate y="1" angle="50"/>
    <translate x="-1"/></transform></shape>
  <shape type="disk"><ref id="b"/><transform name="to_world"><scale x="2" y="1"/>
    <rotate x="1" angle="-60"/><translate x="1"/></transform></shape>
  <shape type="cube"><ref id="b"/><transform name="to_world"><scale value="0.4"/>
    <rotate z="1" angle="20"/><translate x="1" y="1"/></transform></shape>
  <shape type="shapegroup" id="g"><shape type="cylinder"><ref id="b"/></shape></shape>
  <shape type="instance"><ref id="g"/><transform name="to_world"><scale value="0.3"/>
    <rotate y="1" angle="70"/><translate y="1.2"/></transform></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="4"/><rotate x="1" angle="-90"/>
    <translate y="-1"/></transform></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="0.5"/><rotate x="1" angle="90"/>
    <translate x="-2" y="3"/></transform><emitter type="area"/></shape>
  <emitter type="spot"><transform name="to_world"><lookat origin="3, 3, 1" target="0, 0, 0"
    up="0, 1, 0"/></transform><rgb name="intensity" value="20, 10, 5"/></emitter>
  <emitter type="point"><point name="position" x="2" y="1" z="3"/></emitter>
  <emitter type="directional"><vector name="direction" x="1" y="-2" z="-0.5"/></emitter>
  <emitter type="envmap"><string name="filename" value="sky.png"/><transform name="to_world">
    <rotate y="1" angle="30"/></transform></emitter>
</scene>
"""


@pytest.mark.slow
def test_a_camera_that_mirrors_sees_the_mirrored_scene(tmp_path):
    sky = np.random.default_rng(0).integers(0, 255, (4, 8, 3), dtype=np.uint8)
    Image.fromarray(sky).save(tmp_path / "sky.png")
    (tmp_path / "own.xml").write_text(MIRRORED)
    with pytest.warns(SceneWarning, match="the whole scene is mirrored"):
        scene = read_file(tmp_path / "own.xml", Scene)
    rng = np.random.default_rng(1)
    x, y = rng.uniform(0.0, scene.film.width, 96), rng.uniform(0.0, scene.film.height, 96)
    ours_o, ours_d = camera_rays(scene, x, y)
    o, d = (rays * [-1.0, 1.0, 1.0] for rays in (ours_o, ours_d))
    own = own_scene(scene)
    t, *_ = hits_of(own, o, d)
    np.testing.assert_allclose(scene.intersect(ours_o, ours_d).t, t, rtol=1e-4)
    # Many: some lights are selected rarely, and few samples do not show how noisy they are.
    ours = scene.radiance(ours_o, ours_d, spp=4096)
    theirs, error = theirs_along(own, o, d, 4096)
    spread = np.hypot(ours.standard_error, error) + 1e-3 * theirs + 1e-6
    assert np.abs((ours.mean - theirs) / spread).max() < 5.5
    sensor = own.sensors()[0]
    mi = mitsuba()

    def ray(place: Any) -> tuple[Any, ...]:
        point = mi.Point2f(place.x, place.y)
        found, _ = sensor.sample_ray_differential(0.0, 0.5, point, mi.Point2f(0.5, 0.5))
        return (found.d,)

    at = np.column_stack([x / scene.film.width, y / scene.film.height, np.zeros(96)])
    np.testing.assert_allclose(for_rays(ray, at)[0], d, atol=2e-6)


@pytest.mark.filterwarnings("ignore:.*its moments are left out")
def test_the_window_of_the_film_follows_the_size(tmp_path):
    scene = scene_of(tmp_path)
    for size in ((32, 24), (64, 48), (8, 6)):
        film = scene.film.model_copy(update=dict(zip(("width", "height"), size, strict=True)))
        assert picture(own_scene(scene.changed(film=film)), 1, 0).shape == (size[1], size[0], 3)
    film = scene.film.model_copy(update={"width": 40, "height": 30})
    mean = picture(own_scene(scene.changed(film=film)), 64, 0).mean()
    np.testing.assert_allclose(mean, picture(own_scene(scene), 64, 0).mean(), rtol=0.02)
    for width, height in ((33, 24), (64, 24)):
        film = scene.film.model_copy(update={"width": width, "height": height})
        with pytest.raises(UntranslatableError):
            own_scene(scene.changed(film=film))


@pytest.mark.filterwarnings("ignore:.*its moments are left out")
def test_a_film_that_the_file_does_not_have_is_added(tmp_path):
    text = SCENE.replace("EXTRA", "").replace("SENSOR", "perspective")
    for found in ('<film type="hdrfilm">FILM</film>', '<sampler type="multijitter"><integer '):
        assert found in text
    start, end = text.index("<sampler"), text.index("</sensor>")
    (tmp_path / "own.xml").write_text(text[:start] + text[end:])
    scene = Changes(size="40x30").load(tmp_path / "own.xml")
    assert picture(own_scene(scene), 1, 0).shape == (30, 40, 3)


@pytest.mark.filterwarnings("ignore:.*its moments are left out")
def test_a_change_of_the_file_changes_the_case(tmp_path):
    def key(scene: Scene) -> str:
        return case_key(scene, BUDGET, (), backend())

    keys = {key(scene_of(tmp_path)), key(scene_of(tmp_path, grey="0.5"))}
    keys.add(key(scene_of(tmp_path, FILM.replace("mitchell", "catmullrom"))))
    assert len(keys) == 3
    assert key(scene_of(tmp_path)) in keys


SUMMED = """<scene version="3.0.0">
  <integrator type="direct">SAMPLES</integrator>
  <sensor type="perspective"><float name="fov" value="40"/>
    <transform name="to_world"><lookat origin="0, 1, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="32"/>
      <integer name="height" value="24"/></film>
  </sensor>
  <shape type="sphere"/>
  <emitter type="point"><point name="position" x="2" y="3" z="4"/>
    <rgb name="intensity" value="20"/></emitter>
</scene>
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "samples",
    [
        '<integer name="emitter_samples" value="3"/><integer name="bsdf_samples" value="2"/>',
        '<integer name="shading_samples" value="3"/>',
    ],
)
def test_light_samples_that_mitsuba_adds_up_are_foretold(tmp_path, samples):
    """Three times as bright in Mitsuba's own picture, which is its error and not ours."""
    path = tmp_path / "summed.xml"
    path.write_text(SUMMED.replace("SAMPLES", samples))
    case = compared(read_file(path, Scene, None))
    assert case.verdict == "agree", case.reason
    assert any("adds up its samples" in note and "with 3" in note for note in case.notes)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*its moments are left out")
def test_clipping_planes_are_those_of_the_file(tmp_path):
    """And a file without has Mitsuba's: what is farther than 10,000 is cut."""
    extra = '<float name="near_clip" value="4.3"/><float name="far_clip" value="5"/>'
    scene = placed(tmp_path, FILM, "perspective", extra)
    assert (scene.camera.near, scene.camera.far) == (4.3, 5.0)
    case = compared(scene)
    assert case.verdict == "agree", case.reason
    (tmp_path / "plain").mkdir()
    plain = placed(tmp_path / "plain", FILM, "perspective", "")
    assert (plain.camera.near, plain.camera.far) == (0.01, 10_000.0)
    assert compared(scene.changed(camera=plain.camera)).verdict == "differ"

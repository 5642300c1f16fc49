"""Mitsuba's `sunsky`, read as an environment map that Mitsuba evaluates."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from comparisons.commands.compare import convert
from comparisons.lights.sunsky import HEIGHT, WIDTH
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.scene import for_rays
from comparisons.translator.reading import read_file
from reference_rt.core.vec3 import Vec3, luminance
from reference_rt.integrators import Whitted
from reference_rt.lights import EnvironmentMap
from reference_rt.rendering import query
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import SceneWarning

SCENE = """<scene version="3.0.0">
  <sensor type="perspective"/>
  <emitter type="sunsky"><float name="turbidity" value="4"/>
    <rgb name="albedo" value="0.2, 0.3, 0.1"/><float name="sun_scale" value="SUN"/>
    <vector name="sun_direction" value="0.4, 0.3, 0.8"/>
    <transform name="to_world"><rotate x="1" angle="-90"/><rotate y="1" angle="25"/></transform>
  </emitter>
  <shape type="sphere"/>
</scene>
"""


def scene_of(folder: Path, sun: float) -> Scene:
    (folder / "sky.xml").write_text(SCENE.replace("SUN", str(sun)))
    with pytest.warns(SceneWarning, match=f"{WIDTH} x {HEIGHT}"):
        return read_file(folder / "sky.xml", Scene, None)


def test_radiance_is_mitsubas(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, 0.0)
    rng = np.random.default_rng(3)
    d = rng.normal(size=(4000, 3))
    d /= np.linalg.norm(d, axis=1)[:, None]
    d = d[np.abs(d[:, 1]) > 0.01].astype(np.float32).astype(float)  # off the horizon
    o = 3.0 * d
    ours = query.radiance_without_noise(scene.tables, Whitted().setup(), o, d)
    mi = mitsuba()
    own = mi.load_file(str(tmp_path / "sky.xml"))

    def along(origin: object, way: object) -> tuple[object, ...]:
        si = own.ray_intersect(mi.Ray3f(mi.Point3f(origin), way))
        return (own.environment().eval(si),)

    theirs = for_rays(along, o, d)[0]
    assert theirs.mean() > 0.01
    # Between pixels 0.18 degrees apart the sky is linear to 1e-3, but for the sun's aureole.
    error = np.abs(ours - theirs).max(axis=1) / theirs.max()
    assert np.quantile(error, 0.99) < 1e-3
    assert error.max() < 1e-2


@pytest.mark.slow
def test_the_suns_flux_is_mitsubas(tmp_path: Path) -> None:
    """Against Mitsuba's own light samples, whose weights have the flux as their mean."""
    scene = scene_of(tmp_path, 1.0)
    (light,) = scene.lights
    assert isinstance(light, EnvironmentMap)
    total = float(light.tabulate(scene.folder).total[0])
    mi = mitsuba()
    (emitter,) = mi.load_file(str(tmp_path / "sky.xml")).emitters()
    u = np.random.default_rng(4).random((1 << 16, 2))

    def weight(x: object, y: object) -> tuple[object, ...]:
        it = mi.SurfaceInteraction3f() if mi.variant().startswith("scalar") else None
        if it is None:
            import drjit as dr

            it = dr.zeros(mi.SurfaceInteraction3f)
        return (emitter.sample_direction(it, mi.Point2f(x, y), True)[1],)

    found = np.asarray(luminance(Vec3(*for_rays(weight, *u.T)[0].T)))
    error = found.std() / np.sqrt(len(found))
    # Four standard errors, and what the map rounds: a thousandth.
    assert abs(found.mean() - total) < 4.0 * error + 1e-3 * total
    assert error < 0.02 * total


def test_conversion_writes_the_map_beside_the_scene(tmp_path: Path) -> None:
    scene_of(tmp_path, 1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        convert(tmp_path / "sky.xml", tmp_path / "sky.yaml")
    again = Scene.load(tmp_path / "sky.yaml")
    (light,) = again.lights
    assert isinstance(light, EnvironmentMap)
    assert (tmp_path / light.file).is_file()

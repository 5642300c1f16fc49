"""Linking asks for all that is called; tables and links are made once."""

import dataclasses
import os
import pickle
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from builders import HELPERS, SCENES, same_in_plain_python
from small_scenes import same, small

import reference_rt as rt
from reference_rt.jit.kernel import is_compiled
from reference_rt.rendering import kernels
from reference_rt.rendering.accumulation import jobs_of
from reference_rt.rendering.render import render
from reference_rt.scene import build

needs_jit = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")

DIVERSE = (
    "camera_thin_lens",
    "cornell_box",
    "csg_nested",
    "display_modes",  # ray casting
    "instances",
    "many_lights",  # with a light tree
    "material_blend",
    "textured_room",
    "whitted_classic",
)
"""Scenes for the quick run: with and without hierarchy, solids, instances, nested materials, ..."""

INTEGRATORS: dict[str, dict[str, Any]] = {
    "path": {"integrator": rt.Path(), "sampler": rt.Sobol(spp=4)},
    "direct": {
        "integrator": rt.Direct(light_samples=2, bsdf_samples=2),
        "sampler": rt.Independent(spp=4),
    },
    "whitted": {"integrator": rt.Whitted(), "sampler": rt.Grid(spp=4)},
    "ray_cast": {"integrator": rt.RayCast(), "sampler": None},
}


SOME = ("textured_room",)
"""Scenes for the quick run by all integrators."""

# ---- what linking asks for ----------------------------------------------------------------------


def render_linked(*names):
    """Render scenes by each integrator, linked.  What is not asked for ends the process."""
    warnings.simplefilter("ignore")  # of scenes that some integrators cannot do justice to
    for name in names:
        scene = small(name)
        for integrator, changes in INTEGRATORS.items():
            print(name, integrator, flush=True)
            layers = () if integrator == "ray_cast" else scene.film.layers
            film = scene.film.model_copy(update={"width": 8, "height": 6, "layers": layers})
            try:
                picture = render(scene.changed(film=film, **changes))
            except rt.SceneError:  # a material that only another integrator can do justice to
                assert integrator != scene.integrator.type
                continue
            assert np.isfinite(picture.colour).all()
    print("done")


@pytest.mark.slow
@needs_jit
@pytest.mark.parametrize(
    "names",
    [SOME, pytest.param([p.stem for p in SCENES.glob("*.yaml")], marks=pytest.mark.slow)],
    ids=["some", "all"],
)
def test_linking_asks_for_all_that_is_called(names):
    folders = os.pathsep.join((str(Path(__file__).parent), str(HELPERS)))
    done = subprocess.run(
        [sys.executable, "-c", f"import test_kernels as t; t.render_linked(*{tuple(names)})"],
        env=os.environ | {"PYTHONPATH": folders},
        capture_output=True,
        text=True,
        check=False,
    )
    last = done.stdout.splitlines()[-1:]
    assert (done.returncode, last) == (0, ["done"]), done.stderr
    # All is in the cache now: nothing depends on the process.
    for name in names:
        scene = small(name)
        view = scene.camera.setup(scene.film.width, scene.film.height)
        calls = kernels.calls_for(jobs_of(scene), scene.tables, view, scene.film.filter.setup())
        assert all(is_compiled(*call) for call in calls)
        assert calls


# ---- what is made once --------------------------------------------------------------------------


def test_tables_and_links_are_made_once(monkeypatch):
    """For a scene, whatever its film, camera and sampler; and never for other integrators."""
    scene = small("cornell_box")
    expected = render(scene)
    monkeypatch.setattr(build, "build_tables", None)
    monkeypatch.setattr(kernels, "linked_scene", None)
    assert same(render(scene), expected)
    for part in ({"spp": 2}, {"size": (5, 4)}, {"seed": 7}):
        assert np.isfinite(render(scene, **part).colour).all()
    with pytest.raises(TypeError):
        render(scene.changed(integrator=rt.Path(max_depth=3)))


OTHER_CAMERA = """
import reference_rt as rt
from small_scenes import small
scene = small("cornell_box")
other = scene.changed(camera=rt.Orthographic(eye=(0.0, 0.0, 4.0), target=(0.0, 0.0, 0.0)))
for one in {order}:
    print(rt.render(one).colour.tobytes().hex()[:64])
"""


@needs_jit
def test_another_camera_of_a_scene_in_a_new_process():
    """Its kernels are in the cache, but not loaded when the scene's links are there already."""

    def told(order):
        done = subprocess.run(
            [sys.executable, "-c", OTHER_CAMERA.format(order=order)],
            env=os.environ | {"PYTHONPATH": os.pathsep.join([str(HELPERS), *sys.path])},
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout.split()

    one, another = told("(scene, other)")
    assert told("(other, scene)") == [another, one]
    assert one != another


def test_a_scene_that_is_sent_away_has_no_links():
    scene = small("cornell_box")
    render(scene)
    assert scene.tables.links
    copy = pickle.loads(pickle.dumps(scene))
    assert copy.tables.links == {}
    assert same(render(copy), render(scene))
    assert scene.without_tables().tables is not scene.tables


def test_other_tables_have_other_links():
    """Links hold the addresses of the tables that they were made of."""
    scene = small("cornell_box")
    tables, before = scene.tables, render(scene)
    areas = tables.lights.areas
    dark = areas._replace(radiance=areas.radiance._replace(value=0.0 * areas.radiance.value))
    other = dataclasses.replace(tables, lights=tables.lights._replace(areas=dark))
    assert other.links == {}
    assert not render(scene, tables=other).colour.any()
    assert same(render(scene), before)


def layers_of_all(folder, file):
    """Of tiny pictures of diverse scenes, all layers."""
    found = {}
    for name in DIVERSE:
        scene = small(name)
        film = scene.film.model_copy(update={"width": 4, "height": 3})
        layers = render(scene.changed(film=film)).layers
        found |= {f"{name} {layer}": array for layer, array in layers.items()}
    np.savez(file, **found)


@pytest.mark.slow
@needs_jit
def test_plain_python_has_the_same_bits(tmp_path):
    """Of all stages and integrators, in every layer."""
    assert len(same_in_plain_python(layers_of_all, tmp_path).files) > 40

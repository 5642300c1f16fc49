"""Linked and specialised kernels: the same bits, and linking asks for all that is called."""

import functools
import os
import signal
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from builders import HELPERS, SCENES, same_in_plain_python
from small_scenes import LAYERS, same, small

import reference_rt as rt
from reference_rt.jit.kernel import is_compiled
from reference_rt.rendering import kernels
from reference_rt.rendering.accumulation import jobs_of
from reference_rt.rendering.render import render

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

ALL = [
    pytest.param(path.stem, marks=() if path.stem in DIVERSE else pytest.mark.slow)
    for path in sorted(SCENES.glob("*.yaml"))
]

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
                picture = render(scene.changed(film=film, **changes), specialised=False)
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
        linked = kernels.Linked(jobs_of(scene), scene.tables, view, scene.film.filter.setup())
        assert all(is_compiled(*call) for call in linked.calls)
        assert linked.calls


# ---- the same bits ------------------------------------------------------------------------------


@pytest.mark.slow
@needs_jit
@pytest.mark.parametrize("name", ALL)
def test_linked_and_specialised_kernels_give_the_same_bits(name):
    """In every layer."""
    scene = small(name)
    linked, specialised = (render(scene, specialised=k) for k in (False, True))
    assert same(linked, specialised)
    assert len(np.unique(linked.layers[linked.shown])) > 3


@pytest.mark.slow
@needs_jit
@pytest.mark.parametrize("integrator", [rt.Path(), rt.Direct(), rt.Whitted()], ids=lambda i: i.type)
def test_given_rays_have_the_same_bits(integrator, monkeypatch):
    scene = small("cornell_box")
    rays = scene.camera_rays()
    module, found = sys.modules["reference_rt.rendering.query.radiance"], []
    for specialised in (False, True):
        running = functools.partial(kernels.Running, specialised=specialised)
        monkeypatch.setattr(module, "Running", running)
        found.append(scene.radiance(*rays, 4, integrator=integrator))
    for linked, own in zip(*found, strict=True):
        assert linked.tobytes() == own.tobytes()
    assert len(np.unique(found[0].mean)) > 100


def pictures(folder, file):
    """Write the picture of one scene by each choice of kernels."""
    scene = small("cornell_box").changed(film=rt.Film(width=6, height=4, layers=LAYERS))
    found = {str(k): render(scene, specialised=k) for k in (None, False, True)}
    np.savez(
        file, **{f"{k} {name}": layer for k, p in found.items() for name, layer in p.layers.items()}
    )


@pytest.mark.slow
def test_plain_python_knows_no_difference(tmp_path):
    arrays = same_in_plain_python(pictures, tmp_path)
    for name in ("colour", *LAYERS):
        first, *others = (arrays[f"{k} {name}"].tobytes() for k in (None, False, True))
        assert others == [first, first]


@pytest.mark.slow
@needs_jit
def test_specialised_kernels_are_used_where_they_are_compiled(monkeypatch):
    scene = small("cornell_box")
    expected = render(scene, specialised=True)
    monkeypatch.setattr(kernels, "linked_scene", None)  # which would be called to link
    assert same(render(scene), expected)


@needs_jit
def test_pictures_of_one_kind_are_added_up(monkeypatch):
    """None is long enough by itself to compile specialised kernels for it."""
    forks = []

    def fork():
        child = os.fork()
        if child == 0:
            signal.pause()
        forks.append(child)
        return child

    monkeypatch.setattr(kernels.parallel_compile, "may_fork", lambda: True)
    monkeypatch.setattr(kernels, "fork_with_compiler", fork)
    monkeypatch.setattr(kernels.Specialised, "are_compiled", lambda self: False)
    monkeypatch.setattr(kernels, "BREAK_EVEN", 0.0)
    monkeypatch.setattr(kernels, "_spent", {})
    monkeypatch.setattr(kernels, "_children", {})
    scene = small("cornell_box")
    render(scene)
    assert not forks
    render(scene)
    render(scene)
    assert [*kernels._children.values()] == forks
    assert len(forks) == 1

    def interrupt(what, fraction):
        if what == "render":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render(scene, progress=interrupt)
    assert not kernels._children
    with pytest.raises(ChildProcessError):
        os.waitpid(forks[0], 0)

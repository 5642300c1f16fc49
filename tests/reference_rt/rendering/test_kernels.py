"""Linked and specialised kernels: the same bits, also where one takes over from the other, and no
child is left."""

import functools
import os
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from builders import HELPERS, SCENES, same_in_plain_python

import reference_rt as rt
from reference_rt.jit.parallel_compile import has_ended
from reference_rt.rendering import kernels
from reference_rt.rendering.render import render

needs_jit = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")

LAYERS = ("albedo", "normal", "depth", "id", "variance")

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


def small(name):
    """A scene of `scenes/` in few pixels and samples, with all layers."""
    scene = rt.Scene.load(SCENES / f"{name}.yaml")
    casts = isinstance(scene.integrator, rt.RayCast)
    film = {"width": 24, "height": 16, "layers": () if casts else LAYERS}
    sampler = scene.resolved_sampler
    if not isinstance(sampler, rt.Grid):
        sampler = sampler.model_copy(update={"spp": 4})
    return scene.changed(film=scene.film.model_copy(update=film), sampler=sampler)


def same(a, b):
    """Whether two pictures have the same layers with the same bits."""
    return a.layers.keys() == b.layers.keys() and all(
        a.layers[name].tobytes() == b.layers[name].tobytes() for name in a.layers
    )


# ---- what linking asks for ----------------------------------------------------------------------


def render_linked(*names):
    """Render scenes by each integrator, linked.  What is not asked for ends the process."""
    warnings.simplefilter("ignore")  # of scenes that some integrators cannot do justice to
    for name in names:
        scene = small(name)
        for integrator, changes in INTEGRATORS.items():
            print(name, integrator, flush=True)
            film = scene.film
            if integrator == "ray_cast":
                film = film.model_copy(update={"layers": ()})
            try:
                picture = render(scene.changed(film=film, **changes), specialised=False)
            except rt.SceneError:  # a material that only another integrator can do justice to
                assert integrator != scene.integrator.type
                continue
            assert np.isfinite(picture.colour).all()
    print("done")


@needs_jit
@pytest.mark.parametrize(
    "names",
    [DIVERSE, pytest.param([p.stem for p in SCENES.glob("*.yaml")], marks=pytest.mark.slow)],
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


# ---- the same bits ------------------------------------------------------------------------------


@needs_jit
@pytest.mark.parametrize("name", ALL)
def test_linked_and_specialised_kernels_give_the_same_bits(name):
    """In every layer."""
    scene = small(name)
    linked, specialised = (render(scene, specialised=k) for k in (False, True))
    assert same(linked, specialised)
    assert len(np.unique(linked.layers[linked.shown])) > 3


@needs_jit
@pytest.mark.parametrize("integrator", [rt.Path(), rt.Direct(), rt.Whitted()], ids=lambda i: i.type)
def test_given_rays_have_the_same_bits(integrator, monkeypatch):
    scene = small("cornell_box")
    rays = scene.camera_rays()
    module, found = sys.modules["reference_rt.rendering.query.radiance"], []
    for specialised in (False, True):
        running = functools.partial(kernels.Running, specialised=specialised)
        monkeypatch.setattr(module, "Running", running)
        found.append(scene.radiance(rays.o, rays.d, 4, integrator=integrator))
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


def test_plain_python_knows_no_difference(tmp_path):
    arrays = same_in_plain_python(pictures, tmp_path)
    for name in ("colour", *LAYERS):
        first, *others = (arrays[f"{k} {name}"].tobytes() for k in (None, False, True))
        assert others == [first, first]


@needs_jit
def test_specialised_kernels_are_used_where_they_are_compiled(monkeypatch):
    scene = small("cornell_box")
    expected = render(scene, specialised=True)
    monkeypatch.setattr(kernels, "linked_scene", None)  # which would be called to link
    assert same(render(scene), expected)


# ---- one takes over from the other --------------------------------------------------------------

forks = pytest.mark.skipif(
    numba.config.DISABLE_JIT or not hasattr(os, "fork"), reason="there is no second process"
)


class Watched:
    """A render whose tiles, from the second on, wait until `ready(running)`.

    children: the processes that were started;  used: the kernels that were called.
    """

    def __init__(self, monkeypatch, ready):
        self.children: list[int] = []
        self.used: list[Any] = []
        self.running: Any = None
        run, fork = kernels.Running.run, kernels.fork_with_compiler

        def watched_run(running, k):
            self.running, inner, calls = running, run(running, k), []

            def tile(*pixels):
                calls.append(pixels)
                end = time.monotonic() + 300.0
                while len(calls) > 1 and not ready(self) and time.monotonic() < end:
                    time.sleep(0.01)
                self.used.append(running.kernels[k])
                inner(*pixels)

            return tile

        def watched_fork():
            child = fork()
            if child:
                self.children.append(child)
            return child

        rendering = sys.modules["reference_rt.rendering.render"]
        monkeypatch.setattr(kernels.Running, "run", watched_run)
        monkeypatch.setattr(kernels, "fork_with_compiler", watched_fork)
        monkeypatch.setattr(kernels, "may_fork", lambda: True)
        monkeypatch.setattr(kernels, "WAIT", 0.0)
        monkeypatch.setattr(kernels, "WORTHWHILE", 0.0)
        monkeypatch.setattr(rendering, "SAMPLES_PER_TILE", 256)


def as_if_not_compiled(monkeypatch, often=1):
    """As if the specialised kernels were not in the cache, the first `often` times that is asked
    for."""
    asked, compiled = [], kernels._Specialised.are_compiled

    def are_compiled(specialised):
        asked.append(specialised)
        return len(asked) > often and compiled(specialised)

    monkeypatch.setattr(kernels._Specialised, "are_compiled", are_compiled)


def slow_children(monkeypatch):
    here, precompile = os.getpid(), kernels.precompile

    def compiling(*call):
        if os.getpid() != here:
            time.sleep(1000.0)
        return precompile(*call)

    monkeypatch.setattr(kernels, "precompile", compiling)


@pytest.fixture
def scene():
    return small("cornell_box")


@forks
def test_specialised_kernels_take_over_between_tiles(scene, monkeypatch):
    expected = render(scene, specialised=False)
    as_if_not_compiled(monkeypatch)
    watched = Watched(monkeypatch, lambda w: w.running._is_final)
    assert same(render(scene, threads=2), expected)
    assert len(watched.children) == 1
    assert len(set(map(id, watched.used))) > len(watched.running.kernels)
    assert has_ended(watched.children[0])


@forks
def test_a_child_that_stores_nothing_changes_nothing(scene, monkeypatch):
    """On a full disk, for example."""
    expected = render(scene, specialised=False)
    as_if_not_compiled(monkeypatch, often=1000)
    watched = Watched(monkeypatch, lambda w: w.running._is_final)
    assert same(render(scene, threads=2), expected)
    assert len(watched.children) == 1
    assert set(map(id, watched.used)) == set(map(id, watched.running.kernels))


@forks
@pytest.mark.parametrize("end", ["finished", "error", "Ctrl-C"])
def test_no_child_is_left(end, scene, monkeypatch):
    as_if_not_compiled(monkeypatch)
    slow_children(monkeypatch)
    watched = Watched(monkeypatch, lambda w: w.children)
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)

    def say(what, fraction):
        if watched.children and end == "error":
            raise RuntimeError("the terminal is gone")
        if watched.children and end == "Ctrl-C":
            signal.raise_signal(signal.SIGINT)

    try:
        if end == "finished":
            render(scene, threads=2, progress=say)
        else:
            with pytest.raises(RuntimeError if end == "error" else KeyboardInterrupt):
                render(scene, threads=2, progress=say)
    finally:
        signal.signal(signal.SIGINT, handler)
    assert len(watched.children) == 1
    assert has_ended(watched.children[0])


@forks
def test_a_short_render_starts_no_child(scene, monkeypatch):
    as_if_not_compiled(monkeypatch)
    watched = Watched(monkeypatch, lambda w: True)
    monkeypatch.setattr(kernels, "WORTHWHILE", 1e9)
    render(scene, threads=2)
    assert watched.children == []


# ---- without a cache ----------------------------------------------------------------------------

_FULL = """
import errno
from reference_rt.jit import kernel_cache

def replacing(path):
    raise OSError(errno.ENOSPC, "No space left on device")

kernel_cache.replacing = replacing
"""

_RENDER = """
import sys
import numpy as np
import test_kernels as t
picture = t.render(t.small("cornell_box"), threads=2)
np.savez(sys.argv[1], **picture.layers)
"""


@needs_jit
@pytest.mark.parametrize("fault", ["unwritable", pytest.param("full", marks=pytest.mark.slow)])
def test_it_renders_without_a_cache(fault, scene, tmp_path):
    folders = os.pathsep.join((str(Path(__file__).parent), str(HELPERS)))
    folder = tmp_path / "cache"
    if fault == "unwritable":
        folder.touch()  # a file, in which no folder can be made, even by root
    subprocess.run(
        [
            sys.executable,
            "-c",
            (_FULL if fault == "full" else "") + _RENDER,
            str(tmp_path / "a.npz"),
        ],
        env=os.environ | {"PYTHONPATH": folders, "REFERENCE_RT_CACHE": str(folder)},
        check=True,
    )
    expected, found = render(scene).layers, np.load(tmp_path / "a.npz")
    assert set(found.files) == set(expected)
    assert all(found[name].tobytes() == expected[name].tobytes() for name in expected)
    if fault == "full":
        assert [path for path in folder.rglob("*") if path.is_file()] == []

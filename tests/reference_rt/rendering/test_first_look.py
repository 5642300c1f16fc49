"""The first picture while kernels compile: it becomes the picture itself, to the last bit."""

import itertools
import threading
from types import SimpleNamespace

import numpy as np
import pytest
from builders import SCENES
from galleries import gallery_of_lights, gallery_of_materials, gallery_of_shapes

import reference_rt as rt
from reference_rt.cli.picture_above import first_look, pixels_of
from reference_rt.rendering import first_look as first_looks
from reference_rt.rendering.first_look import (
    FEWEST,
    FIRST_STEP,
    PIXELS,
    FirstLook,
    _bytes_of,
    grid_of,
    in_order,
)
from reference_rt.rendering.plain_python import plain_tile

SMALL = rt.Film(width=9, height=6)


def shapes(folder):
    return gallery_of_shapes(folder).changed(sampler=rt.Sobol(spp=3))


def materials(folder):
    return gallery_of_materials(folder).changed(sampler=rt.Independent(spp=2))


def lights(folder):
    return gallery_of_lights(folder).changed(integrator=rt.Whitted(), sampler=rt.Grid(spp=4))


def direct(folder):
    return rt.Scene.load(SCENES / "soft_shadows.yaml").changed(
        integrator=rt.Direct(), sampler=rt.Sobol(spp=2)
    )


def media(folder):
    return rt.Scene.load(SCENES / "fog.yaml").changed(sampler=rt.Sobol(spp=2))


def cast_for_normals(folder):
    return gallery_of_shapes(folder).changed(integrator=rt.RayCast(show="normal"))


def other_layers(folder):
    """Only what is shown is computed."""
    film = rt.Film(width=9, height=6, layers=("variance", "albedo", "depth", "bvh_steps"))
    return rt.Scene.load(SCENES / "mesh_knot.yaml").changed(film=film, sampler=rt.Sobol(spp=2))


def shown(scene, wait=60.0):
    """The pictures of a first look that is let come to its end."""
    seen = []
    with FirstLook(scene, seen.append) as look:
        look.begin()
        if look._process is not None:
            look._process.wait(wait)
            look._reader.join(wait)
    return seen


@pytest.mark.parametrize(
    "scene", [shapes, materials, lights, direct, media, cast_for_normals, other_layers]
)
def test_it_becomes_the_picture(scene, tmp_path):
    scene = scene(tmp_path)
    if scene.film.width != SMALL.width:
        scene = scene.changed(film=SMALL)
    last = shown(scene)[-1]
    assert (last == pixels_of(rt.render(scene))).all()


def test_large_pictures_are_seen_by_some_of_their_pixels(monkeypatch):
    """The first sample of each `step`-th pixel of a row and a column."""
    scene = rt.Scene.load(SCENES / "whitted_classic.yaml")
    scene = scene.changed(film=rt.Film(width=150, height=110), sampler=rt.Grid(spp=1))
    step, columns, rows = grid_of(150, 110)
    assert step > 1
    assert columns * rows <= PIXELS
    monkeypatch.setattr(first_looks, "_BETWEEN", 0.0)
    seen = shown(scene)
    assert seen[-1].shape == (rows, columns, 3)
    assert (seen[-1] == pixels_of(rt.render(scene))[::step, ::step]).all()
    # None has pixels that nothing is known of, and they become finer.
    assert len(seen) > 10
    square = np.ones((FIRST_STEP, FIRST_STEP, 1))
    first = np.kron(seen[0][::FIRST_STEP, ::FIRST_STEP], square)[:rows, :columns]
    assert (seen[0] != first).any(axis=2).mean() < 0.2


@pytest.mark.parametrize("size", [(1, 1), (64, 64), (65, 64), (640, 480), (9, 4096), (100_000, 3)])
def test_each_sample_comes_once(size):
    grid = grid_of(*size)
    assert (grid.columns - 1) * grid.step < size[0]
    assert (grid.rows - 1) * grid.step < size[1]
    places = [*in_order(grid, 2)]
    samples = [place[:3] for place in places]
    expected = itertools.product(range(grid.columns), range(grid.rows), range(2))
    assert sorted(samples) == [*expected]
    # The first width covers all.
    covered = np.zeros((grid.rows, grid.columns), bool)
    for column, row, _, width in places:
        if width < places[0].width:
            break
        covered[row : row + width, column : column + width] = True
    assert covered.all()


def test_the_integrator_light_has_none():
    scene = rt.Scene.load(SCENES / "cornell_box.yaml").changed(integrator=rt.Light(), film=SMALL)
    assert shown(scene) == []


def test_it_takes_no_memory_for_large_scenes(monkeypatch):
    """Of which the second process would hold another copy."""
    scene = rt.Scene.load(SCENES / "mesh_knot.yaml").changed(film=SMALL, sampler=rt.Sobol(spp=1))
    data = scene.tables.geometry.bvh
    assert _bytes_of(plain_tile(scene)) > _bytes_of(data) > 100_000
    monkeypatch.setattr(first_looks, "MOST_BYTES", _bytes_of(data))
    assert shown(scene) == []


def test_a_render_goes_on_without_it(monkeypatch):
    def refused(*args, **options):
        raise BlockingIOError("no more processes")

    monkeypatch.setattr(first_looks.subprocess, "Popen", refused)
    scene = rt.Scene.load(SCENES / "display_modes.yaml").changed(film=SMALL)
    with FirstLook(scene, print) as look:
        look.compiling(0, FEWEST)
        look.compiling(FEWEST, FEWEST)


def test_it_begins_with_many_kernels_and_ends_with_the_last(monkeypatch):
    begun = []
    monkeypatch.setattr(FirstLook, "begin", lambda self: begun.append(True))
    scene = rt.Scene.load(SCENES / "cornell_box.yaml")
    with FirstLook(scene, print) as look:
        look.compiling(0, FEWEST - 1)
        assert not begun
        look.compiling(0, FEWEST)
        assert begun


def test_nothing_outlives_it():
    scene = rt.Scene.load(SCENES / "fog.yaml")
    before = threading.active_count()
    with FirstLook(scene, print) as look:
        look.compiling(0, FEWEST)
        process = look._process
        assert process.poll() is None
        look.compiling(FEWEST, FEWEST)
        assert process.poll() is not None
    assert threading.active_count() == before


@pytest.mark.parametrize("draws", [True, False])
def test_it_is_for_terminals(draws):
    """Where nobody looks no process is started."""
    scene = rt.Scene.load(SCENES / "display_modes.yaml").changed(film=SMALL)
    told, drawn = [], []
    bar = SimpleNamespace(
        draws=draws,
        compiling=lambda done, total: told.append((done, total)),
        show_pictures=drawn.append,
    )
    with first_look(scene, bar) as compiling:
        compiling(0, FEWEST)
        for thread in threading.enumerate():
            if thread.daemon and "_read" in thread.name:
                thread.join(60.0)
        compiling(FEWEST, FEWEST)
    assert told == [(0, FEWEST), (FEWEST, FEWEST)]
    assert bool(drawn) == draws
    assert all(pixels.shape == (SMALL.height, SMALL.width, 3) for ((_, pixels),) in drawn)

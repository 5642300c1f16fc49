"""Pictures: the same bits for any number of threads, other bits for another seed; progress."""

import dataclasses
import importlib
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from builders import SCENES
from small_scenes import LAYERS, same

import reference_rt as rt
from reference_rt.rendering import units
from reference_rt.rendering.render import render

FILM = rt.Film(width=40, height=23)


@pytest.fixture(scope="module")
def cornell():
    return rt.Scene.load(SCENES / "cornell_box.yaml").changed(
        film=FILM, sampler=rt.Sobol(spp=4, seed=1)
    )


@pytest.mark.parametrize("band", [1, 7, 64, 10**9])
def test_same_bits_for_any_threads_and_tiling(cornell, band, monkeypatch):
    """In every layer."""
    cornell = cornell.changed(film=FILM.model_copy(update={"layers": LAYERS}))
    expected = render(cornell, threads=1)
    monkeypatch.setattr(units, "SAMPLES_PER_TILE", band)
    for threads in (1, 2, 3):
        assert same(render(cornell, threads=threads), expected)


def test_seeds_differ(cornell):
    one = render(cornell).colour
    other = render(cornell.changed(sampler=rt.Sobol(spp=4, seed=2))).colour
    # Nearly every pixel that light reaches: 23 x 40, of which the border outside the box is black.
    assert (one != other).any(axis=-1).mean() > 0.5
    assert np.array_equal(one == 0, other == 0) or np.mean((one == 0) != (other == 0)) < 0.2


def test_tables_may_be_given(cornell):
    tables = rt.build_tables(cornell)
    assert np.array_equal(render(cornell, tables=tables).colour, render(cornell).colour)


def test_progress_is_reported_in_order(cornell):
    said = []
    render(cornell, progress=lambda *what: said.append(what))
    kinds = [what for what, _ in said]
    assert kinds == sorted(kinds)  # "compile", then "render"
    fractions = [fraction for what, fraction in said if what == "render"]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    assert min(fractions) >= 0.0


def test_an_error_in_progress_stops_the_render(cornell):
    def stop(what, fraction):
        if what == "render":
            raise KeyboardInterrupt

    before = threading.active_count()
    with pytest.raises(KeyboardInterrupt):
        render(cornell.changed(sampler=rt.Sobol(spp=2**16)), progress=stop)
    assert threading.active_count() == before


def test_an_interrupt_while_bands_are_handed_out(monkeypatch):
    """Of the hundred bands that wait by then, a sleeping thread must not go on to do them all."""
    module = importlib.import_module("reference_rt.rendering.query.radiance")
    ran = []

    class Pool(ThreadPoolExecutor):
        def submit(self, run, begin, end):
            if begin == 100:
                raise KeyboardInterrupt
            return super().submit(run, begin, end)

    def band(begin, end, *samples):
        time.sleep(0.02)
        ran.append(begin)

    monkeypatch.setattr(module, "ThreadPoolExecutor", Pool)
    with pytest.raises(KeyboardInterrupt):
        module.run_tiles(band, 1000, units.SAMPLES_PER_TILE, 1)
    assert len(ran) < 50


def test_the_shape_of_the_picture(cornell):
    picture = render(cornell)
    assert picture.colour.shape == (23, 40, 3)
    assert picture.colour.dtype == np.float64
    assert picture.nonfinite == 0
    assert set(picture.seconds) == {"tables", "compile", "render"}


def test_nonfinite_pixels_are_counted():
    layer = np.zeros((2, 3, 3))
    layer[0, 1, 2], layer[1, 1] = np.nan, np.inf
    picture = rt.Picture({"colour": layer})
    assert picture.nonfinite == 2
    assert dataclasses.replace(picture, layers={"colour": np.ones((1, 1, 3))}).nonfinite == 0
    others = {"depth": np.full((2, 3), np.inf), "id": np.full((2, 3), -1.0)}
    others["variance"] = np.full((2, 3, 3), 1e39)
    picture = rt.Picture({"colour": np.ones((2, 3, 3)), **others})
    assert picture.nonfinite == 6
    assert picture.nonfinite_pixels.tolist() == [[x, y] for y in range(2) for x in range(3)]
    del others["variance"]
    assert rt.Picture({"colour": np.ones((2, 3, 3)), **others}).nonfinite == 0


def test_a_picture_that_cannot_fit_is_refused(cornell):
    with pytest.raises(rt.SceneError, match="pixels need") as caught:
        render(cornell.changed(film=rt.Film(width=10**7, height=10**7)))
    assert caught.value.path == ("film",)


def test_ray_casting_gives_every_layer():
    """A sphere of radius 1 seen along its axis: what the middle pixel must show is known."""
    scene = rt.Scene(
        camera=rt.Orthographic(eye=(0, 0, 5), width=4),
        film=rt.Film(width=5, height=3),
        integrator=rt.RayCast(show="distance"),
        materials={"paint": rt.Diffuse(reflectance=(0.25, 0.5, 0.75))},
        shapes=(rt.Sphere(material="paint"),),
    )
    picture = render(scene)
    layers = picture.layers
    assert picture.shown == "distance"
    assert layers["distance"][1, 2] == 4.0
    assert layers["normal"][1, 2].tolist() == [0.0, 0.0, 1.0]
    assert layers["colour"][1, 2].tolist() == [0.25, 0.5, 0.75]
    assert layers["id"][1, 2] == 0
    assert np.isinf(layers["distance"][0, 0])
    assert layers["id"][0, 0] == -1
    assert not layers["colour"][0, 0].any()
    assert not layers["normal"][0, 0].any()


def test_left_is_left_and_up_is_up():
    """A sphere to the right of and above the axis is in the right upper part of the picture."""
    scene = rt.Scene(
        camera=rt.Orthographic(eye=(0, 0, 5), width=4),
        film=rt.Film(width=4, height=4),
        integrator=rt.RayCast(),
        shapes=(rt.Sphere(center=(1.5, 0.5, 0), radius=0.25),),
    )
    assert np.argwhere(render(scene).layers["id"] == 0).tolist() == [[1, 3]]

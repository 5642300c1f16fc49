"""`Picture`: saved, shown, in notebooks; settings of `render`; reading images back."""

import io
import json

import numpy as np
import pytest
from builders import SCENES
from PIL import Image

import reference_rt as rt
from reference_rt.core.exr import read_exr
from reference_rt.rendering.image import srgb
from reference_rt.rendering.render import with_settings

LAYERS = ("albedo", "normal", "position", "depth", "id", "variance")


@pytest.fixture(scope="module")
def scene():
    scene = rt.Scene.load(SCENES / "cornell_box.yaml")
    film = scene.film.model_copy(update={"layers": LAYERS})
    return with_settings(scene.changed(film=film), size=(12, 9), spp=4)


@pytest.fixture(scope="module")
def picture(scene):
    return rt.render(scene)


def opened(png):
    return np.array(Image.open(io.BytesIO(png)))


def test_exr_has_all_layers_and_its_provenance(picture, scene, tmp_path):
    picture.save(tmp_path / "a.exr")
    channels, header = read_exr(tmp_path / "a.exr")
    assert {name.partition(".")[0] for name in channels} == {*"RGB", *LAYERS}
    assert header["sceneSha256"] == scene.digest()
    assert json.loads(header["sampler"])["spp"] == 4
    assert np.array_equal(rt.read_image(tmp_path / "a.exr"), picture.colour.astype(np.float32))


def test_layers_are_read_by_name(picture, tmp_path):
    picture.save(tmp_path / "a.exr")
    albedo = rt.read_image(tmp_path / "a.exr", "albedo")
    assert np.array_equal(albedo, picture.layers["albedo"].astype(np.float32))


def test_png_is_srgb_of_the_shown_layer(picture, tmp_path):
    picture.save(str(tmp_path / "a.png"))
    shown = rt.read_image(tmp_path / "a.png")
    # Half a code of 255 is at most this much of a linear value, where the curve is steepest: at 1.
    assert np.abs(shown - np.clip(picture.colour, 0, 1)).max() <= 0.5 / 255 * 2.4 / 1.055


def test_every_layer_as_png(picture):
    for layer in ("colour", *LAYERS):
        pixels = opened(picture.png(layer))
        assert pixels.shape == (9, 12, 3)
        assert pixels.std() > 0, layer


def test_a_notebook_shows_dark_and_bright_pictures():
    """The 99th percentile is white, unless it is between 1/4 and 1 already."""
    for brightness in (1e-6, 0.01, 1.0, 1e6):
        colour = np.linspace(0, 1, 300).reshape(10, 10, 3) * brightness
        pixels = opened(rt.Picture({"colour": colour})._repr_png_())
        assert pixels.max() == 255 if brightness != 1.0 else pixels.max() >= 250
        assert np.unique(pixels).size > 50
        exact = opened(rt.Picture({"colour": colour}).png(exposure=1.0))
        assert np.array_equal(exact, np.round(255 * np.clip(srgb(colour), 0, 1)))


def test_pictures_without_a_level_are_shown_as_they_are():
    for value, expected in ((0.0, [0, 0, 0]), (np.nan, [255, 0, 255]), (np.inf, [255, 0, 255])):
        picture = rt.Picture({"colour": np.full((4, 4, 3), value)})
        assert (opened(picture._repr_png_()) == expected).all()
        assert "img" in picture._repr_html_()


def test_a_notebook_has_all_layers(picture):
    page = picture._repr_html_()
    assert page.count("<img") == 1 + len(LAYERS)
    assert all(f"<figcaption>{name}<" in page for name in LAYERS)
    assert "12 x 9" in page


def test_repr_is_short(picture):
    assert repr(picture).startswith(f"<Picture 12 x 9: colour, {', '.join(LAYERS)}")
    assert len(repr(picture)) < 100


def test_show_opens_a_viewer(picture, monkeypatch):
    opened = []
    monkeypatch.setattr(Image.Image, "show", lambda image: opened.append(image.size))
    picture.show()
    assert opened == [(12, 9)]


def test_files_are_rendered_with_settings():
    path = SCENES / "cornell_box.yaml"
    settings = {"size": (8, 6), "spp": 2, "seed": 5}
    expected = rt.render(with_settings(rt.Scene.load(path), **settings)).colour
    assert expected.shape == (6, 8, 3)
    for file in (path, str(path)):
        assert np.array_equal(rt.render(file, **settings).colour, expected)
    other = rt.render(path, size=(8, 6), spp=2, seed=6).colour
    assert not np.array_equal(expected, other)


def test_impossible_settings_are_named(scene):
    for name, value in (("spp", 0), ("size", (0, 4)), ("seed", -1), ("integrator", "magic")):
        with pytest.raises(rt.SceneError, match="expected") as caught:
            with_settings(scene, **{name: value})
        assert caught.value.path == (name,)


def test_an_integrator_may_be_a_name_or_a_description(scene):
    assert with_settings(scene, integrator="ray_cast").integrator == rt.RayCast()
    assert with_settings(scene, integrator=rt.Path(max_depth=3)).integrator.max_depth == 3
    assert with_settings(scene, integrator="path") == scene
    fixed = rt.Scene(integrator=rt.Direct(), sampler=rt.Grid(spp=4))
    assert with_settings(fixed, integrator="whitted").resolved_sampler == fixed.sampler
    assert isinstance(with_settings(fixed, integrator="path").resolved_sampler, rt.Sobol)


def test_scenes_have_a_preview(scene):
    preview = scene.preview(width=20)
    assert preview.colour.shape == (15, 20, 3)
    assert opened(scene._repr_png_()).shape == (240, 320, 3)


def test_what_is_no_image_is_an_image_error(tmp_path):
    for text in (b"", b"not an image", b"v/1\x01", b"PF\n1 1\n-1\n"):
        (tmp_path / "a.exr").write_bytes(text)
        with pytest.raises(rt.ImageError, match=r"a\.exr"):
            rt.read_image(tmp_path / "a.exr")
    with pytest.raises(rt.ImageError, match=r"none\.png.*No such file"):
        rt.read_image(tmp_path / "none.png")


def test_the_version_is_that_of_the_installed_package():
    assert rt.__version__.count(".") == 2

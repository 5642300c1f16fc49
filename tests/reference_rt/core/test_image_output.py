"""Image files: read back as they were written; whole or absent; NaN and infinity stay visible."""

import os

import numpy as np
import pytest
from PIL import Image

import reference_rt as rt
from reference_rt.core.exr import read_exr
from reference_rt.rendering import image
from reference_rt.util.files import _short, check_writable, replacing

PROVENANCE = {"software": "reference_rt 0", "scene": "a scene", "sampler": '{"spp": 4}'}


def picture(shown="colour"):
    """Every layer, with values of all sizes, and misses in the last column."""
    rng = np.random.default_rng(51)
    colour = rng.uniform(0, 1, (5, 7, 3)) * 10.0 ** rng.uniform(-30, 30, (5, 7, 1))
    layers = {
        "colour": colour,
        "distance": rng.uniform(1, 9, (5, 7)),
        "normal": rng.normal(size=(5, 7, 3)),
        "id": np.arange(35.0).reshape(5, 7),
    }
    layers["distance"][:, -1], layers["normal"][:, -1], layers["id"][:, -1] = np.inf, 0.0, -1.0
    return rt.Picture(layers, shown)


def test_exr_keeps_every_layer_as_float32(tmp_path):
    made = picture()
    image.write(tmp_path / "a.exr", made, PROVENANCE)
    channels, header = read_exr(tmp_path / "a.exr")
    expected = {
        **{c: made.colour[..., i] for i, c in enumerate("RGB")},
        "distance.Z": made.layers["distance"],
        **{f"normal.{c}": made.layers["normal"][..., i] for i, c in enumerate("XYZ")},
        "id.V": made.layers["id"],
    }
    assert set(channels) == set(expected)
    for name, values in expected.items():
        assert np.array_equal(channels[name], values.astype(np.float32)), name
    assert {key: header[key] for key in PROVENANCE} == PROVENANCE


def test_exr_keeps_what_is_not_finite(tmp_path):
    colour = np.zeros((2, 2, 3))
    colour[0, 0], colour[0, 1], colour[1, 0] = np.nan, np.inf, -np.inf
    image.write(tmp_path / "a.exr", rt.Picture({"colour": colour}), PROVENANCE)
    channels, _ = read_exr(tmp_path / "a.exr")
    assert np.array_equal(channels["G"], colour[..., 1], equal_nan=True)


def test_png_shows_what_is_not_finite_as_magenta(tmp_path):
    colour = np.full((2, 2, 3), 0.5)
    colour[0, 0, 1], colour[0, 1, 2] = np.nan, np.inf
    image.write(tmp_path / "a.png", rt.Picture({"colour": colour}), PROVENANCE)
    pixels = np.array(Image.open(tmp_path / "a.png"))
    assert pixels[0].tolist() == [[255, 0, 255]] * 2
    # srgb(0.5) = 0.73536: 187.5 of 255, which is above the half.
    assert pixels[1].tolist() == [[188, 188, 188]] * 2


def test_srgb_is_the_standards_formula():
    x = np.array([-1.0, 0.0, 0.0031308, 0.0031309, 0.18, 0.5, 1.0, 4.0])
    expected = [v * 12.92 if v <= 0.0031308 else 1.055 * v ** (1 / 2.4) - 0.055 for v in x]
    # Two roundings of the same formula, and a power in between: a few units in the last place.
    assert np.allclose(image.srgb(x), expected, rtol=1e-15, atol=0)
    assert np.isnan(image.srgb(np.nan))
    assert image.srgb(np.inf) == np.inf


def test_png_holds_srgb_clipped_to_eight_bits(tmp_path):
    colour = np.array([[[0.0, 1.0, 7.0], [0.2140411, 0.0031308, 1e-9]]])
    image.write(tmp_path / "a.png", rt.Picture({"colour": colour}), PROVENANCE)
    with Image.open(tmp_path / "a.png") as read:
        # 0.2140411 is the linear value of 127.5: the next float decides; 12.92 * 0.0031308 * 255
        # is 10.3.
        assert read.text == PROVENANCE
        pixels = np.array(read)[0]
    assert pixels[0].tolist() == [0, 255, 255]
    assert pixels[1, 0] in (127, 128)
    assert pixels[1, 1:].tolist() == [10, 0]


@pytest.mark.parametrize("shown", ["colour", "distance", "normal", "id"])
def test_display_shows_misses_black_and_hits_not(shown):
    values = image.display(picture(shown))
    assert values.shape == (5, 7, 3)
    if shown == "colour":
        return
    assert not values[:, -1].any()
    assert values[:, :-1].any(axis=-1).all()
    assert values.min() >= 0 or shown == "normal"


def test_nearer_is_brighter():
    made = picture("distance")
    shown = image.display(made)[:, :-1, 0].ravel()
    order = np.argsort(made.layers["distance"][:, :-1].ravel())
    assert (np.diff(shown[order]) < 0).all()
    assert (shown[order[0]], shown[order[-1]]) == pytest.approx((1.0, 0.1))


def test_neighbouring_ids_have_different_colours():
    shown = image.display(picture("id"))[:, :-1].reshape(-1, 3)
    steps = np.abs(np.diff(shown, axis=0)).max(axis=1)
    assert steps.min() > 0.2


def test_an_error_while_writing_leaves_the_old_file(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def fail():
        with replacing(path) as temporary:
            temporary.write_text("half of the ne")
            assert path.read_text() == "old"
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_text() == "old"
    with replacing(path) as temporary:
        temporary.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("length", [239, 240, 241, 254, 255])
def test_names_of_any_length(tmp_path, length):
    for letter in ("n", "é"):
        name = "".join([letter] * ((length - 4) // len(letter.encode()))) + ".exr"
        check_writable(tmp_path / name)
        image.write(tmp_path / name, picture(), PROVENANCE)
        assert read_exr(tmp_path / name)
    killed = tmp_path / f".{'0' * 8}-{_short(name)}"
    killed.touch()
    os.utime(killed, (0, 0))
    check_writable(tmp_path / name)
    assert len(list(tmp_path.iterdir())) == 2


def test_links_are_written_through(tmp_path):
    """The file that a link names is replaced, beside it; the link stays."""
    (tmp_path / "there").mkdir()
    link, other = tmp_path / "a.exr", tmp_path / "b.exr"
    link.symlink_to("b.exr")
    other.symlink_to(tmp_path / "there" / "c.exr")
    for _ in range(2):  # without the file, and with it
        check_writable(link)
        image.write(link, picture(), PROVENANCE)
        assert link.is_symlink()
        assert other.is_symlink()
        assert [path.name for path in (tmp_path / "there").iterdir()] == ["c.exr"]
    assert len(list(tmp_path.iterdir())) == 3
    loop = tmp_path / "loop.exr"
    loop.symlink_to("loop.exr")
    device = tmp_path / "device.exr"
    device.symlink_to("/dev/null")
    for path in (loop, device):  # never replaced
        with pytest.raises(rt.ImageError, match=path.name):
            check_writable(path)
        with pytest.raises(rt.ImageError, match=path.name):
            image.write(path, picture(), PROVENANCE)
        assert path.is_symlink()


def test_unwritable(tmp_path):
    (tmp_path / "file").write_text("")
    for name in ("a.exr", "a.png"):
        with pytest.raises(rt.ImageError, match="cannot be written"):
            image.write(tmp_path / "file" / name, picture(), PROVENANCE)
    with pytest.raises(rt.UsageError, match=r"'.gif' is not supported; expected"):
        image.write(tmp_path / "a.gif", picture(), PROVENANCE)
    assert len(list(tmp_path.iterdir())) == 1


def test_reading_what_is_no_exr(tmp_path):
    for content in (b"", b"rubbish", b"v/1\x01\x02\x00\x00\x00cut"):
        (tmp_path / "a.exr").write_bytes(content)
        with pytest.raises(rt.ImageError, match="cannot be read as EXR"):
            read_exr(tmp_path / "a.exr")
    with pytest.raises(rt.ImageError, match="cannot be read as EXR"):
        read_exr(tmp_path / "missing.exr")

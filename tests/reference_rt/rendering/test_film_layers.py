"""Layers beside the colour: closed forms, and the samples' own spread.

Scenes have all layers, and the same kinds of shapes and materials, so that they share kernels.
"""

import numpy as np
import pytest
from builders import SCENES
from command_line import invoke

import reference_rt as rt
from reference_rt.cameras.film import Film, LanczosFilter
from reference_rt.core import transform
from reference_rt.core.exr import read_exr
from reference_rt.textures import Checker

ALL = ("albedo", "normal", "depth", "id", "variance")


@pytest.fixture(scope="module")
def cornell():
    return rt.Scene.load(SCENES / "cornell_box.yaml").changed(
        film=Film(width=12, height=9, layers=ALL), sampler=rt.Independent(spp=8, seed=1)
    )


BEHIND = rt.Rectangle(material="lamp", transform=(transform.Translate(translate=(0, 0, 9)),))
"""A lamp behind the eye that shines away: every scene has one."""


def wall(material="paint", lamp=None, **changes):
    """A wall of 4 x 4 checks of colours (0.75, 0.5, 0.25) and 0.125, 5 before the eye, that covers
    the left three quarters of the picture, 8 pixels wide; or of another material."""
    materials = {
        "paint": rt.Diffuse(reflectance="checks"),
        "air": rt.Diffuse(),
        "lamp": rt.Emissive(radiance=(1, 1, 1), base="chalk"),
        "chalk": rt.Diffuse(reflectance=(1, 1, 1)),
    }
    if lamp is not None:
        materials["lamp"] = rt.Emissive(radiance=lamp, base="chalk")
    parts = {
        "camera": rt.Orthographic(eye=(0, 0, 5), width=4),
        "film": Film(width=8, height=8, layers=ALL),
        "sampler": rt.Independent(spp=16, seed=2),
        "integrator": rt.Whitted(),
        "textures": {"checks": Checker(first=(0.75, 0.5, 0.25), second=(0.125,) * 3)},
        "shapes": (
            rt.Sphere(center=(0, 0, 9), material="air"),  # behind the eye: takes the number 0
            rt.Rectangle(
                material=material,
                transform=(
                    transform.Scale(scale=(2, 2, 1)),
                    transform.Translate(translate=(-1, 0, 0)),
                ),
            ),
            BEHIND,
        ),
    }
    return rt.Scene(materials=materials, **(parts | changes))


def test_colour_is_the_same_bits_with_and_without(cornell):
    bare = cornell.changed(film=Film(width=12, height=9))
    picture, plain = rt.render(cornell), rt.render(bare)
    assert list(picture.layers) == ["colour", *ALL]
    assert list(plain.layers) == ["colour"]
    assert np.array_equal(picture.colour, plain.colour)


@pytest.mark.parametrize("degrees", [0.0, 30.0])
@pytest.mark.parametrize("stretch", [1.0, 3.0])
def test_the_normal_is_that_of_the_vertices(stretch, degrees):
    """A triangle before all pixels whose vertices have one normal, (0.6, 0, 0.8), not its own.
    Under a stretch along x it is that of the inverse transpose, (0.6 / stretch, 0, 0.8)."""
    steps = (
        transform.Scale(scale=(stretch, 1, 1)),
        transform.Rotate(rotate=transform.Turn(axis=(0, 0, 1), degrees=degrees)),
    )
    mesh = rt.Mesh(
        vertices=((-20, -20, 0), (20, -20, 0), (0, 30, 0)),
        faces=((0, 1, 2),),
        normals=((0.6, 0, 0.8),) * 3,
        material="paint",
        transform=steps,
    )
    found = rt.render(wall(shapes=(mesh, BEHIND))).layers["normal"]
    tilted = np.array([0.6 / stretch, 0.0, 0.8])
    x, _, z = tilted / np.linalg.norm(tilted)
    turn = np.radians(degrees)
    expected = np.array([x * np.cos(turn), x * np.sin(turn), z])
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=1e-14)


def test_a_checked_wall():
    """Pixels are inside of one check each; the last two columns miss."""
    layers = rt.render(wall()).layers
    x, y = np.meshgrid(np.arange(8), np.arange(8))
    hit = x < 6
    # The wall's uv: u from -3 to 1 in x, v from -2 to 2 in y; a check is a half of each, 4 pixels.
    u, v = ((x + 0.5) / 2 - 2 + 3) / 4, 1 - (y + 0.5) / 8
    first = (u < 0.5) == (v < 0.5)
    albedo = np.where(first[..., None], (0.75, 0.5, 0.25), 0.125) * hit[..., None]
    assert np.array_equal(layers["albedo"], albedo)  # sums of 16 equal numbers of few bits
    assert np.array_equal(layers["normal"], np.where(hit[..., None], (0.0, 0.0, 1.0), 0.0))
    assert np.array_equal(layers["depth"], np.where(hit, 5.0, np.inf))
    assert np.array_equal(layers["id"], np.where(hit, 1, -1))


def test_albedo_is_seen_through_the_filter():
    """As the colour is: a white emitter's albedo layer, if white, is its picture."""
    film = Film(width=8, height=8, filter=LanczosFilter(), layers=ALL)
    picture = rt.render(wall("lamp", film=film))
    assert np.array_equal(picture.colour, picture.layers["albedo"])
    assert np.array_equal(picture.colour[..., 0], picture.layers["normal"][..., 2])
    assert (picture.colour < 0.0).any()  # beside the edge, where Lanczos' filter rings
    assert (picture.colour > 1.0).any()


def test_smooth_normals():
    """A sphere's in the middle of its pixels, and shorter where they bend inside a pixel."""
    ball = rt.Sphere(radius=1.0)
    scene = wall(shapes=(ball, BEHIND), film=Film(width=33, height=33, layers=ALL))
    n = rt.render(scene).layers["normal"]
    x, y = np.meshgrid(np.arange(33) - 16, 16 - np.arange(33))
    inside = np.hypot(x, y) < 7
    at = np.stack([x, y], axis=-1) * (4 / 33)
    # A pixel is 0.12 wide: the mean of 16 points in it is within half of it.
    assert np.abs(n[inside][:, :2] - at[inside]).max() < 0.06
    length = np.linalg.norm(n[inside], axis=-1)
    assert (length < 1.0).all()
    assert (length > 0.99).all()


def test_depth_and_id_are_ray_castings(cornell):
    layers = rt.render(cornell).layers
    cast = rt.render(cornell.changed(integrator=rt.RayCast(), sampler=None)).layers
    assert set(cast) == {"colour", "distance", "normal", "id", "uv"}
    assert np.array_equal(layers["depth"], cast["distance"])
    assert np.array_equal(layers["id"], cast["id"])
    assert len(np.unique(layers["id"])) > 4


def test_variance_is_that_of_the_samples(cornell):
    """Independent samples do not depend on how many there are: from the means of 1 to 8 all eight
    are known."""
    film = Film(width=12, height=9)
    sums = [np.zeros((9, 12, 3))]
    for spp in range(1, 9):
        scene = cornell.changed(film=film, sampler=rt.Independent(spp=spp, seed=1))
        sums.append(spp * rt.render(scene).colour)
    samples = np.diff(sums, axis=0)
    expected = samples.var(axis=0, ddof=1) / 8
    found = rt.render(cornell).layers["variance"]
    # The samples from differences of sums, each rounded a few times.
    scale = np.abs(samples).max(axis=0) ** 2
    assert (np.abs(found - expected) <= 64 * 2.0**-53 * scale).all()
    assert (found > 0).mean() > 0.5


def test_variance_of_what_does_not_vary():
    variance = rt.render(wall("lamp", lamp=(0.1, 1e5, 3))).layers["variance"]
    # Sums of 16 equal numbers round, each time by half a unit of at most 16 times the number.
    assert (variance <= (16 * 2.0**-53 * np.array([0.1, 1e5, 3])) ** 2).all()


def test_variance_predicts_the_spread_of_means():
    """Over 4096 pixels that are each half covered: p (1 - p) / n, and what the means do."""
    edge = (transform.Scale(scale=(5, 5000, 1)), transform.Translate(translate=(-5, 0, 0)))
    scene = wall(
        shapes=(rt.Rectangle(material="lamp", transform=edge), rt.Sphere(center=(0, 0, 9))),
        camera=rt.Orthographic(eye=(0, 0, 1), width=1),
        film=Film(width=1, height=4096, layers=ALL),
    )
    picture = rt.render(scene)
    means, variance = picture.colour[..., 0].ravel(), picture.layers["variance"][..., 0].ravel()
    expected = 0.25 / 16
    assert abs(variance.mean() - expected) < 4 * variance.std() / 64
    # The variance of 4096 nearly normal means: relative standard error sqrt(2 / 4095).
    assert means.var(ddof=1) == pytest.approx(expected, rel=4 * np.sqrt(2 / 4095))


def test_variance_needs_two_samples(cornell):
    with pytest.raises(rt.SceneError, match="expected at least 2") as caught:
        rt.render(cornell.changed(sampler=rt.Sobol(spp=1)))
    assert caught.value.path == ("film", "layers")


def test_files(tmp_path):
    """The .exr has all layers; the .png is the same file with and without them."""
    text = (SCENES / "cornell_box.yaml").read_text()
    text = text.replace("{type: sobol, spp: 64}", "{type: independent, spp: 4}")
    assert "independent" in text
    film = next(line for line in text.splitlines() if line.startswith("film:"))
    for name, layers in (("plain", ""), ("layers", f", layers: [{', '.join(ALL)}]")):
        (tmp_path / name).mkdir()
        scene = tmp_path / name / "scene.yaml"
        scene.write_text(text.replace(film, film.rstrip("} ") + layers + "}"))
        for suffix in ("exr", "png"):
            arguments = ("-o", tmp_path / name / f"out.{suffix}", "--size", "16x10")
            done = invoke("render", scene, *arguments)
            assert done.exit_code == 0, done.stderr
    plain, _ = read_exr(tmp_path / "plain" / "out.exr")
    channels, _ = read_exr(tmp_path / "layers" / "out.exr")
    assert set(plain) == set("RGB")
    assert set(channels) == {
        *"RGB", "albedo.R", "albedo.G", "albedo.B", "normal.X", "normal.Y", "normal.Z",
        "depth.Z", "id.V", "variance.R", "variance.G", "variance.B",
    }  # fmt: skip
    assert all(np.array_equal(plain[c], channels[c]) for c in "RGB")
    assert np.isfinite(channels["albedo.R"]).all()

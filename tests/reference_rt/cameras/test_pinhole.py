"""A pinhole whose hole has a size: its rays, its blur and its light, by geometry."""

import math

import numpy as np
import pytest
from builders import U
from camera_checks import LENSES, POINTS, TILTED, local, rays

import reference_rt as rt
from reference_rt.cameras import Pinhole

HOLE = Pinhole(**TILTED, film_width=0.3, film_distance=0.2, hole_radius=0.05)


@pytest.mark.parametrize(
    "sizes",
    [(0.3, 0.2, 0.05), (0.3, 0.2, 3.0), (1e-3, 7.0, 1e-9), (40.0, 2.0, 2.0), (1e9, 1e9, 1e7)],
)
def test_rays_of_a_film_point_part_from_it(sizes):
    """Through each point of the hole passes the line from the film's point; at distance z before
    the hole it is r (1 + z / d) times the hole's unit disk off the line through the middle."""
    width, distance, radius = sizes
    camera = Pinhole(**TILTED, film_width=width, film_distance=distance, hole_radius=radius)
    eye = np.array(camera.eye)
    middle = local(camera, rays(camera, POINTS)[1])
    film = -distance * middle / middle[:, 2:]
    for lens in LENSES:
        o, d = (local(camera, x) for x in rays(camera, POINTS, lens=lens))
        q = o - local(camera, eye)
        error = 32 * U * (np.abs(eye).max() + radius)
        assert np.abs(q[:, 2]).max() <= error
        assert np.hypot(q[:, 0], q[:, 1]).max() <= radius * (1 + 8 * U) + error
        back = q - d * (distance / d[:, 2:])
        scale = np.abs(film).max() + radius
        assert np.abs(back - film).max() <= 32 * U * scale + error
        for z in (0.5 * distance, 30.0 * distance):
            spread = q + d * (z / d[:, 2:]) + film * (z / distance)
            expected = q * (1 + z / distance)
            bound = (1 + z / distance) * (32 * U * scale + error)
            assert np.abs(spread - expected)[:, :2].max() <= bound


def test_the_middle_of_the_hole_is_the_point():
    point = HOLE.model_copy(update={"hole_radius": None})
    for one, other in zip(rays(HOLE, POINTS), rays(point, POINTS), strict=True):
        assert np.array_equal(one, other)


def sky(**hole):
    """A picture of a white sky, 9 x 5 pixels."""
    camera = Pinhole(**TILTED, film_width=3.0, film_distance=1.5, **hole)
    return rt.Scene(
        camera=camera,
        film=rt.Film(width=9, height=5),
        sampler=rt.Independent(spp=1024, seed=3),
        integrator=rt.Path(max_depth=1),
        lights=(rt.Constant(radiance=(1.0, 0.5, 2.0)),),
    )


def test_light_grows_with_the_square_of_the_radius():
    """A film point sees a disk of sky: its share is the known form factor of a disk, pi r^2 / d^2
    cos^4 for a small one; without an exposure it is the sky's radiance.  Noise: 1024 samples of
    cos^4 over a pixel and a hole deviate by at most 60 %, so that 6 standard errors are 12 %; of
    means over 45 pixels, 1.7 %."""
    plain = rt.render(sky(hole_radius=0.01)).colour
    assert np.allclose(plain, [1.0, 0.5, 2.0], rtol=1e-12)
    x, y = np.meshgrid((np.arange(45) + 0.5) / 45 - 0.5, (np.arange(25) + 0.5) / 45 - 5 / 18)
    off = 9.0 * (x * x + y * y)  # squared, on the film
    for r in (0.01, 0.1, 1.0):
        picture = rt.render(sky(hole_radius=r, exposure=4.0)).colour
        a = 1.5**2 + off
        share = 0.5 - 0.5 * (a - r * r) / np.sqrt((a + r * r) ** 2 - 4 * r * r * off)
        expected = 4.0 * math.pi * share.reshape(5, 5, 9, 5).mean(axis=(1, 3))
        for channel, radiance in enumerate((1.0, 0.5, 2.0)):
            ratio = picture[..., channel] / (radiance * expected)
            assert np.abs(ratio - 1).max() < 0.12
            assert abs(ratio.mean() - 1) < 0.017


def test_exposure_scales_and_spares_the_layers():
    """Twice the exposure is twice the picture, bit for bit; layers are not exposed."""
    ball = rt.Sphere(center=TILTED["target"])
    pictures = []
    for exposure in (1.0, 2.0):
        scene = sky(hole_radius=0.1, exposure=exposure)
        film = scene.film.model_copy(update={"layers": ("albedo", "normal")})
        pictures.append(rt.render(scene.changed(film=film, shapes=(ball,))))
    assert np.array_equal(2.0 * pictures[0].colour, pictures[1].colour)
    for layer in ("albedo", "normal"):
        assert np.array_equal(pictures[0].layers[layer], pictures[1].layers[layer])

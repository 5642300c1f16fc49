"""The thin lens against its geometry."""

import math

import numpy as np
import pytest
from builders import U
from camera_checks import CAMERAS, LENSES, POINTS, TILTED, VIEW, local, rays

import reference_rt as rt
from reference_rt.cameras import ThinLens, has_lens
from reference_rt.cameras.thin_lens import concentric_disk
from reference_rt.jit.kernel import entry_kernel

LENS = ThinLens(**TILTED, fov=60, aperture_radius=0.3, focus_distance=4)


@pytest.mark.parametrize(
    ("camera", "pinhole"),
    [
        (LENS, rt.Perspective(**TILTED, fov=60)),
        (
            ThinLens(**TILTED, view=VIEW, aperture_radius=2, focus_distance=0.5),
            rt.Perspective(**TILTED, view=VIEW),
        ),
    ],
)
def test_rays_of_a_film_point_meet_in_the_plane_in_focus(camera, pinhole):
    f, eye = camera.focus_distance, np.array(camera.eye)
    _, through_centre = rays(pinhole, POINTS)
    sharp = f * through_centre / local(camera, through_centre)[:, 2:]  # from the eye
    # Numbers: the eye's coordinates, a point of the lens, a point in focus.
    size = np.abs(eye).max() + camera.aperture_radius + np.abs(sharp).max()
    for lens in LENSES:
        o, d = rays(camera, POINTS, lens=lens)
        t = f / local(camera, d)[:, 2:]
        assert np.abs(o + t * d - (eye + sharp)).max() < 16 * U * size


def test_rays_start_on_the_lens():
    rng = np.random.default_rng(81)
    places = []
    for lens in rng.uniform(0, 1, (200, 2)):
        o, _ = rays(LENS, POINTS, lens=lens)
        assert (o == o[0]).all()
        places.append(o[0] - np.array(LENS.eye))
    u, v, forward = local(LENS, np.array(places)).T
    assert np.abs(forward).max() < 16 * U * 5
    r = np.hypot(u, v)
    assert 0.95 * 0.3 < r.max() <= 0.3 * (1 + 64 * U * 5)
    assert (u > 0).any() and (u < 0).any() and (v > 0).any() and (v < 0).any()  # noqa: PT018


def test_the_middle_of_the_lens_is_the_perspective_camera():
    same = rt.Perspective(**TILTED, fov=60)
    for one, other in zip(rays(LENS, POINTS), rays(same, POINTS), strict=True):
        assert np.array_equal(one, other)


@entry_kernel
def _disk(u, out):
    for i in range(len(u)):
        out[i, 0], out[i, 1] = concentric_disk(u[i, 0], u[i, 1])


def disk(u):
    out = np.empty((len(u), 2))
    _disk(np.asarray(u, float), out)
    return out


def test_the_disk_is_covered_evenly():
    p = disk(np.random.default_rng(82).uniform(0, 1, (200_000, 2)))
    r2 = np.sum(p * p, axis=1)
    assert r2.max() <= 1 + 16 * U
    turns = np.arctan2(p[:, 1], p[:, 0]) / (2 * math.pi) % 1
    counts, _, _ = np.histogram2d(r2, turns, bins=(10, 20), range=[[0, 1 + 16 * U], [0, 1]])
    expected = len(p) / 200
    # The quantile 1 - 1e-6 of chi-square with 199 degrees of freedom.
    assert np.sum((counts - expected) ** 2) / expected < 308.60


def test_the_disk_of_the_square():
    """Squares around the middle become circles; axes and diagonals stay; mirror images too."""
    u = np.random.default_rng(83).integers(0, 2**20 + 1, (2000, 2)) / 2**20
    p = disk(u)
    assert np.abs(np.hypot(*p.T) - np.abs(2 * u - 1).max(axis=1)).max() < 8 * U
    assert np.array_equal(disk(np.column_stack([1 - u[:, 0], u[:, 1]])), p * [-1, 1])
    assert np.array_equal(disk(np.column_stack([u[:, 0], 1 - u[:, 1]])), p * [1, -1])
    assert np.array_equal(disk(u[:, ::-1]), p[:, ::-1])
    assert disk([[0.5, 0.5], [1, 0.5], [0.5, 0], [0, 0.5]]).tolist() == [
        [0, 0],
        [1, 0],
        [0, -1],
        [-1, 0],
    ]
    corners = disk([[1, 1], [0, 1], [0, 0], [1, 0]])
    assert np.abs(np.abs(corners) - math.sqrt(0.5)).max() < 4 * U
    # Within an eighth of a turn the angle is pi/4 times the ratio.
    inner = u[(u[:, 0] - 0.5) > np.abs(u[:, 1] - 0.5)]
    angle = math.pi / 4 * (inner[:, 1] - 0.5) / (inner[:, 0] - 0.5)
    q = disk(inner)
    assert np.abs(np.arctan2(q[:, 1], q[:, 0]) - angle).max() < 8 * U


def test_only_a_lens_draws():
    assert {name for name, camera in CAMERAS.items() if has_lens(camera.setup(8, 6))} == {
        name for name in CAMERAS if "lens" in name
    }

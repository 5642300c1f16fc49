"""Cameras for tests, and their rays."""

import numpy as np

import reference_rt as rt
from reference_rt.cameras import LENS_CENTRE, Pinhole, ThinLens, camera_ray
from reference_rt.jit.kernel import entry_kernel

STRAIGHT = {"eye": (0, 0, 0), "target": (0, 0, -1), "up": (0, 1, 0)}
"""u, v, w are x, y, z."""

TILTED = {"eye": (3.0, -2.0, 5.0), "target": (0.3, 0.2, -0.1), "up": (0.1, 1.0, 0.2)}

VIEW = (-0.3, 0.5, -0.1, 0.4)

CAMERAS = {
    "perspective by fov": rt.Perspective(**TILTED, fov=70, fov_axis="diagonal"),
    "perspective by view": rt.Perspective(**TILTED, view=VIEW, distance=0.7),
    "orthographic by width": rt.Orthographic(**TILTED, width=3),
    "orthographic by view": rt.Orthographic(**TILTED, view=VIEW),
    "pinhole": Pinhole(**TILTED, film_width=0.3, film_distance=0.2),
    "pinhole with a hole, no lens": Pinhole(**TILTED, hole_radius=0.1, exposure=3),
    "thin lens by fov": ThinLens(**TILTED, aperture_radius=0.2),
    "thin lens by view": ThinLens(**TILTED, view=VIEW, aperture_radius=0.2, focus_distance=3),
}

LENSES = [(0.5, 0.5), (0.9, 0.55), (0.2, 0.25), (0.5, 0.99), (0.45, 0.01), (0.75, 0.75)]


@entry_kernel
def _rays(view, xy, lens, out):
    for i in range(len(xy)):
        ray = camera_ray(view, xy[i, 0], xy[i, 1], (lens[0], lens[1]))
        out[i, 0], out[i, 1], out[i, 2] = ray.o
        out[i, 3], out[i, 4], out[i, 5] = ray.d


def rays(camera, xy, size=(8, 6), lens=LENS_CENTRE):
    """Origins and directions (n, 3) of film points (n, 2) from 0 to 1."""
    out = np.empty((len(xy), 6))
    _rays(camera.setup(*size), np.asarray(xy, float), np.array(lens), out)
    return out[:, :3], out[:, 3:]


def centres(n_x, n_y):
    """x, y of all pixel centres, from 0 to 1."""
    j, i = np.mgrid[0:n_y, 0:n_x]
    return np.column_stack([(i.ravel() + 0.5) / n_x, (j.ravel() + 0.5) / n_y])


def local(camera, vectors):
    """Coordinates of vectors along the camera's u, v and forward."""
    u, v, w = camera.basis
    return vectors @ np.column_stack([u, v, -w])


POINTS = np.vstack([centres(8, 6), [[0, 0], [1, 0], [0, 1], [1, 1], [0.5, 0.5]]])

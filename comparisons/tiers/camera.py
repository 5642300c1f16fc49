"""The camera: our rays against those of Mitsuba's sensor."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from comparisons.mitsuba_scene import sensor_rays
from comparisons.tiers.bounds import ROUNDINGS, UNIT_ROUNDOFF, largest
from reference_rt.cameras import camera_ray
from reference_rt.film import Film
from reference_rt.kernel import entry_kernel
from reference_rt.scene import Scene
from reference_rt.shapes.shape import FloatArray


@dataclass(frozen=True)
class CameraComparison:
    """What was measured, and one line on what is wrong, empty where nothing is."""

    numbers: dict[str, Any]
    problem: str


def pixel_centres(film: Film, most: int) -> tuple[FloatArray, FloatArray]:
    """x, y (n,) in pixels of the centres of at most `most` pixels, every k-th of each row and
    column."""
    step = 1
    while -(-film.width // step) * -(-film.height // step) > most:
        step += 1
    y, x = np.mgrid[step // 2 : film.height : step, step // 2 : film.width : step]
    if x.size == 0:  # a side shorter than the stride
        y, x = np.mgrid[0 : film.height : step, 0 : film.width : step]
    return x.ravel() + 0.5, y.ravel() + 0.5


@entry_kernel
def _camera_rays(view: Any, x: FloatArray, y: FloatArray, out: FloatArray) -> None:
    for i in range(len(x)):
        ray = camera_ray(view, x[i], y[i])
        out[i, 0], out[i, 1], out[i, 2] = ray.o.x, ray.o.y, ray.o.z
        out[i, 3], out[i, 4], out[i, 5] = ray.d.x, ray.d.y, ray.d.z


def camera_rays(scene: Scene, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Our camera's origins and unit directions (n, 3) through film points in pixels."""
    film = scene.film
    out = np.zeros((len(x), 6))
    _camera_rays(scene.camera.view(film.width, film.height), x / film.width, y / film.height, out)
    return out[:, :3].copy(), out[:, 3:].copy()


def compare_camera(scene: Scene, mi_scene: Any, most: int) -> CameraComparison:
    """Directions, and how far Mitsuba's origins lie off our rays, at pixel centres.

    Bounds: a direction passes matrices whose entries reach the tan of half the angle of view, an
    origin one whose entries reach the eye's coordinates and half the picture's width.
    """
    x, y = pixel_centres(scene.film, most)
    o, d = camera_rays(scene, x, y)
    theirs = sensor_rays(mi_scene, x, y)
    # Before it is made unit a direction is 1 long along the view and tan across: rounded numbers as
    # large as on the picture's rim, 1 / cos there, and then shortened by its own cosine.
    forward = np.subtract(scene.camera.target, scene.camera.eye)
    cosine = d @ (forward / np.linalg.norm(forward))
    direction = np.linalg.norm(theirs.d - d, axis=1)
    direction_bound = ROUNDINGS * UNIT_ROUNDOFF * (1.0 + cosine / cosine.min())
    apart = theirs.o - o
    off_line = np.linalg.norm(apart - np.sum(apart * d, axis=1)[:, None] * d, axis=1)
    reach = largest(o).max() + np.abs(scene.camera.eye).max()
    # Mitsuba's origin lies on the near plane, along its own direction.
    near = np.linalg.norm(apart, axis=1) * direction_bound
    origin_bound = ROUNDINGS * UNIT_ROUNDOFF * reach + near
    numbers = {
        "max_camera_direction_error": float(direction.max()),
        "max_camera_direction_error_over_bound": float((direction / direction_bound).max()),
        "max_camera_origin_error": float(off_line.max()),
    }
    wrong = (direction > direction_bound) | (off_line > origin_bound)
    if not wrong.any():
        return CameraComparison(numbers, "")
    k = int(np.argmax(wrong))
    problem = (
        f"the camera: {np.count_nonzero(wrong)} of {len(x)} rays differ; the first at film point "
        f"({x[k]:g}, {y[k]:g}): ours from {o[k]} along {d[k]}, Mitsuba's from {theirs.o[k]} along "
        f"{theirs.d[k]}"
    )
    return CameraComparison(numbers, problem)

"""The camera: our rays against those of Mitsuba's sensor."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from comparisons.cameras import type_of
from comparisons.cameras.camera import FAR, NEAR
from comparisons.geometry.frame import ROUNDINGS, UNIT_ROUNDOFF
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.counterpart import Counterpart
from comparisons.mitsuba.scene import for_rays
from reference_rt.cameras import LENS_CENTRE
from reference_rt.cameras.film import Film
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.scene import Scene


@dataclass(frozen=True)
class CameraComparison:
    """The measured errors, and the problem in one line, empty if there is none."""

    numbers: dict[str, Any]
    problem: str


def pixel_centres(film: Film, most: int) -> tuple[FloatArray, FloatArray]:
    """x, y (n,) in pixels: the centres of at most `most` pixels, every k-th of each row and
    column."""
    step = 1
    while -(-film.width // step) * -(-film.height // step) > most:
        step += 1
    y, x = np.mgrid[step // 2 : film.height : step, step // 2 : film.width : step]
    if x.size == 0:  # a side shorter than the stride
        y, x = np.mgrid[0 : film.height : step, 0 : film.width : step]
    return x.ravel() + 0.5, y.ravel() + 0.5


def camera_rays(
    scene: Scene, x: FloatArray, y: FloatArray, lens: Sequence[float] = LENS_CENTRE
) -> tuple[FloatArray, FloatArray]:
    """Our camera's origins and unit directions (n, 3) for film points in pixels, through one point
    of its lens: by default the centre, which deterministic integrators use."""
    return scene.camera_rays(np.column_stack([x, y]) - 0.5, lens=lens)


def ends(scene: Scene, d: FloatArray) -> FloatArray:
    """Where our camera's rays with unit directions d (n, 3) end: at the far plane, (n,)."""
    return np.asarray(scene.camera.clip.depth / (d @ -scene.camera.basis[2]))


LENS_SAMPLES = (LENS_CENTRE, (0.9, 0.6), (0.2, 0.3), (0.55, 0.99), (0.4, 0.02))
"""Lens samples of the compared rays: the centre, and one in each triangle of the map from square to
disk."""


def sensor_rays(
    mi_scene: Any, x: FloatArray, y: FloatArray, lens: Sequence[float]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Origins, directions and ends (n, 3) of the same rays from Mitsuba's sensor, whose origins lie
    on the near plane and whose ends on the far one."""
    mi = mitsuba()
    sensor = mi_scene.sensors()[0]
    width, height = (int(s) for s in sensor.film().crop_size())
    # Mitsuba's x points left on the lens too, and the map from square to disk is symmetric.
    aperture = mi.Point2f(1.0 - lens[0], lens[1])

    def ray(u: Any, v: Any) -> tuple[Any, ...]:
        found, _ = sensor.sample_ray_differential(0.0, 0.5, mi.Point2f(u, v), aperture)
        return found.o, found.d, found.d * found.maxt

    o, d, along = for_rays(ray, x / width, y / height)
    return o, d, o + along


def compare_camera(scene: Scene, counterpart: Counterpart, most: int) -> CameraComparison:
    """Compare ray directions, the distances of Mitsuba's origins from our rays, and the clipping
    planes, at pixel centres; for a lens through several of its points.

    Bounds: a direction is rounded in matrices whose entries reach the tangent of the largest angle
    to the axis, an origin in one whose entries reach the eye's coordinates and half the picture's
    width, a plane's distance like both.
    """
    camera, film = scene.camera, scene.film
    x, y = pixel_centres(film, most)
    lens = type_of(camera).lens(camera)
    samples = (LENS_CENTRE,) if lens is None else LENS_SAMPLES
    o, d = _stacked(camera_rays(scene, x, y, sample) for sample in samples)
    their_o, their_d, their_end = _stacked(
        sensor_rays(counterpart, x, y, sample) for sample in samples
    )
    their_o, their_end = counterpart.frame.out(their_o), counterpart.frame.out(their_end)
    forward = -camera.basis[2]
    # Before normalisation a direction is 1 along the axis and tan(angle) across: its rounding
    # errors are as large as in the picture's farthest corner, 1 / cos there, and are then scaled by
    # its own cosine.  A lens subtracts the lens point over the focus distance.
    corners = np.array([[0.0, 0.0, 1.0, 1.0], [0.0, 1.0, 0.0, 1.0]])
    _, rim = camera_rays(scene, corners[0] * film.width, corners[1] * film.height)
    steepest = 1.0 / (rim @ forward).min()
    if lens is not None:
        steepest += lens.radius / abs(lens.focus)
    direction = np.linalg.norm(their_d - d, axis=1)
    direction_bound = ROUNDINGS * UNIT_ROUNDOFF * (1.0 + (d @ forward) * steepest)
    shift = their_o - o
    off_line = np.linalg.norm(shift - np.sum(shift * d, axis=1)[:, None] * d, axis=1)
    eye = np.array([camera.eye], dtype=np.float64)
    # Mitsuba's origin lies on the near plane, along its own direction.
    near = np.linalg.norm(shift, axis=1) * direction_bound
    origin_bound = counterpart.frame.delta(o, eye, np.zeros(1)).max() + near
    numbers = {
        "max_camera_direction_error": float(direction.max()),
        "max_camera_direction_error_over_bound": float((direction / direction_bound).max()),
        "max_camera_origin_error": float(off_line.max()),
    }
    wrong = (direction > direction_bound) | (off_line > origin_bound)
    scale = counterpart.frame.scale
    planes = camera.near or NEAR / scale, camera.far or FAR / scale
    for plane, their_point in zip(planes, (their_o, their_end), strict=True):
        depth = (their_point - eye) @ forward
        rounding = origin_bound + plane * direction_bound / (d @ forward)
        wrong |= np.abs(depth - plane) > rounding
    if not wrong.any():
        return CameraComparison(numbers, "")
    k = int(np.argmax(wrong))
    at = k % len(x)
    problem = (
        f"the camera: {np.count_nonzero(wrong)} of {len(o)} rays differ; the first, at film point "
        f"({x[at]:g}, {y[at]:g}): ours from {o[k]} along {d[k]}, Mitsuba's from {their_o[k]} along "
        f"{their_d[k]}"
    )
    return CameraComparison(numbers, problem)


def _stacked(rays: Iterable[tuple[FloatArray, ...]]) -> tuple[FloatArray, ...]:
    return tuple(np.concatenate(column) for column in zip(*rays, strict=True))

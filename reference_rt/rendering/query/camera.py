"""The rays of a scene's camera."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.cameras import LENS_CENTRE, camera_ray
from reference_rt.core.arrays import FloatArray
from reference_rt.jit.kernel import entry_kernel
from reference_rt.rendering.query.rays import broadcast, in_blocks, numbers, shaped
from reference_rt.scene.build import BuiltScene


class CameraRays(NamedTuple):
    """origins, directions (..., 3): in the world, directions of unit length."""

    origins: FloatArray
    directions: FloatArray


# It takes only the camera, so that all scenes with such a camera share it.
@entry_kernel
def camera_kernel(
    view: Any, x: FloatArray, y: FloatArray, lens: FloatArray, o: FloatArray, d: FloatArray
) -> None:
    for i in range(len(x)):
        ray = camera_ray(view, x[i], y[i], (lens[i, 0], lens[i, 1]))
        o[i, 0], o[i, 1], o[i, 2] = ray.o
        d[i, 0], d[i, 1], d[i, 2] = ray.d


def camera_rays(
    scene: BuiltScene,
    pixels: npt.ArrayLike | None = None,
    offsets: npt.ArrayLike = (0.0, 0.0),
    lens: npt.ArrayLike = LENS_CENTRE,
    threads: int | None = None,
) -> CameraRays:
    """The camera's rays through points of the film, as `render` traces them.

    pixels (..., 2): column and row, counted from the top left; None: all, (height, width);  offsets
    (..., 2): from the pixel's centre, in pixels to the right and down, within [-1/2, 1/2] for
    points of the pixel itself;  lens (..., 2): the numbers in [0, 1) that select the point of a
    thin lens, (1/2, 1/2) for its middle; other cameras ignore them.  All broadcast.  Origins are on
    the camera's near clipping plane, if it has one; the far one, where the rays end, is
    `scene.camera.far`.  Raises ValueError.
    """
    width, height = scene.film.width, scene.film.height
    if pixels is None:
        pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1)
    shape, (pixel, offset, on_lens) = broadcast(
        ("pixels", numbers("pixels", pixels, 2), 1),
        ("offsets", numbers("offsets", offsets, 2), 1),
        ("lens", numbers("lens", lens, 2), 1),
    )
    if not ((on_lens >= 0.0) & (on_lens <= 1.0)).all():
        raise ValueError("lens: expected numbers from 0 to 1")
    x = (pixel[:, 0] + 0.5 + offset[:, 0]) / width
    y = (pixel[:, 1] + 0.5 + offset[:, 1]) / height
    view = scene.camera.setup(width, height)
    o, d = np.empty((2, math.prod(shape), 3))

    def send(k: slice) -> None:
        camera_kernel(view, x[k], y[k], on_lens[k], o[k], d[k])

    in_blocks(send, len(o), threads)
    return CameraRays(shaped(o, shape), shaped(d, shape))

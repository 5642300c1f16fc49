"""What points of the film see, of scenes whose pictures have no noise."""

from collections.abc import Callable

import numpy as np

from reference_rt.cameras.film import BoxFilter
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import Direct, RayCast
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid

Look = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""The radiance (..., 3) at points of the film, and the distance (...) of what is seen there."""


def is_noise_free(scene: Scene) -> bool:
    """Whether a correct picture of the scene has no noise, because its samples are fixed."""
    return scene.integrator.type == "ray_cast" or isinstance(scene.resolved_sampler, Grid)


def look_at(scene: Scene, threads: int | None = None) -> Look | None:
    """None for a scene whose radiance along a ray is random, whose pixels are more than their
    footprint, or whose picture shows something else."""
    integrator = scene.integrator
    shows = not isinstance(integrator, RayCast) or integrator.show == "colour"
    if not (is_noise_free(scene) and shows and isinstance(scene.film.filter, BoxFilter)):
        return None
    # A ray draws one of several lights at random, where it is no pixel of a grid.
    alone = [scene.changed(lights=[light]) for light in scene.lights]
    parts = alone if isinstance(integrator, Direct) and alone else [scene]

    def look(points: FloatArray) -> tuple[FloatArray, FloatArray]:
        rays = scene.camera_rays(points - 0.5, threads=threads)
        return (
            np.sum([part.radiance(*rays, spp=1, threads=threads).mean for part in parts], axis=0),
            scene.first_hits(*rays, threads=threads).t,
        )

    return look

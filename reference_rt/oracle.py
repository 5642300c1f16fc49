"""`Oracle`: what a scene can be asked, as methods; what each does is in `reference_rt.query`."""

import math
from typing import TYPE_CHECKING, cast

import numpy as np
import numpy.typing as npt

from reference_rt.shapes.shape import FloatArray

if TYPE_CHECKING:
    from reference_rt.integrators import AnyIntegrator
    from reference_rt.query import (
        Bsdf,
        CameraRays,
        Crossings,
        Hits,
        Intersections,
        LightSamples,
        LightSources,
        Radiance,
    )
    from reference_rt.scene import Scene
    from reference_rt.tables import SceneTables

# Methods import what they call: it imports the scene.


class Oracle:
    """The methods of `Scene` that ask about rays, surfaces and light.

    Arrays broadcast; rays are origins (..., 3) and directions (..., 3) of any length, t counts in
    units of |d|; a single ray gives numbers and (3,) vectors.  `threads`: default all cores; their
    number changes no bit.  Raises ValueError for arrays of other shapes and for what is not
    numbers, and SceneError for files that cannot be used.
    """

    @property
    def _scene(self) -> "Scene":
        return cast("Scene", self)

    @property
    def _own_tables(self) -> "SceneTables":
        return self._scene.tables

    def intersect(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        t_min: npt.ArrayLike = 0.0,
        t_max: npt.ArrayLike = math.inf,
        threads: int | None = None,
    ) -> "Intersections":
        """What rays meet first at t_min < t < t_max, with points, normals and uv: see
        `reference_rt.query.intersect`."""
        from reference_rt import query

        return query.intersect(self._own_tables, origins, directions, t_min, t_max, threads)

    def first_hits(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        t_min: npt.ArrayLike = 0.0,
        t_max: npt.ArrayLike = math.inf,
        threads: int | None = None,
    ) -> "Hits":
        """The same without points, normals and uv, in less time."""
        from reference_rt import query

        return query.first_hits(self._own_tables, origins, directions, t_min, t_max, threads)

    def occluded(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        t_max: npt.ArrayLike = math.inf,
        t_min: npt.ArrayLike = 0.0,
        threads: int | None = None,
    ) -> npt.NDArray[np.bool_]:
        """Whether anything lies on each ray at t_min < t < t_max."""
        from reference_rt import query

        return query.occluded(self._own_tables, origins, directions, t_max, threads, t_min)

    def crossings(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        t_min: npt.ArrayLike = 0.0,
        t_max: npt.ArrayLike = math.inf,
        threads: int | None = None,
    ) -> "Crossings":
        """All crossings of each ray with the surfaces of all shapes, in order: see
        `reference_rt.query.crossings`."""
        from reference_rt import query

        return query.crossings(self._own_tables, origins, directions, t_min, t_max, threads)

    def camera_rays(
        self,
        pixels: npt.ArrayLike | None = None,
        offsets: npt.ArrayLike = (0.0, 0.0),
        lens: npt.ArrayLike = (0.5, 0.5),
        threads: int | None = None,
    ) -> "CameraRays":
        """The camera's rays through pixels, of all (height, width) where none are given: see
        `reference_rt.query.camera_rays`."""
        from reference_rt import query

        return query.camera_rays(self._scene, pixels, offsets, lens, threads)

    def radiance(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        spp: int | None = None,
        seed: int = 0,
        integrator: "AnyIntegrator | None" = None,
        threads: int | None = None,
    ) -> "Radiance":
        """The radiance along rays, by the scene's integrator or another, and its standard error:
        see `reference_rt.query.radiance`."""
        from reference_rt import query

        return query.radiance(self._scene, origins, directions, spp, seed, integrator, threads)

    def bsdf(self, material: str | None) -> "Bsdf":
        """What a material scatters, to be evaluated and sampled: see `reference_rt.query.Bsdf`."""
        from reference_rt import query

        return query.Bsdf(self._scene, material)

    def light_sources(self) -> "LightSources":
        """What the numbers of lights mean: see `reference_rt.query.LightSources`."""
        from reference_rt import query

        return query.light_sources(self._scene)

    def sample_lights(
        self,
        points: npt.ArrayLike,
        u: npt.ArrayLike,
        normals: npt.ArrayLike = (0.0, 0.0, 0.0),
        threads: int | None = None,
    ) -> "LightSamples":
        """A light, and a direction towards it, for each point: see
        `reference_rt.query.sample_lights`."""
        from reference_rt import query

        return query.sample_lights(self._own_tables, points, u, normals, threads)

    def light_pdf(
        self,
        points: npt.ArrayLike,
        directions: npt.ArrayLike,
        normals: npt.ArrayLike = (0.0, 0.0, 0.0),
        t_min: npt.ArrayLike = 0.0,
        threads: int | None = None,
    ) -> FloatArray:
        """The density with which `sample_lights` picks what is seen in directions: see
        `reference_rt.query.light_pdf`."""
        from reference_rt import query

        return query.light_pdf(self._own_tables, points, directions, normals, t_min, threads)

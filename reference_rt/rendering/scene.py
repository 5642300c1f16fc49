"""`Scene`: a description of a scene, and queries of rays, surfaces and light in it."""

import math

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import AnyIntegrator
from reference_rt.rendering import query
from reference_rt.scene.build import BuiltScene


class Scene(BuiltScene):
    """Everything that determines a picture.  Right-handed world; linear sRGB; scene units.

    The methods answer queries with arrays.  Arrays broadcast; rays are origins (..., 3) and
    directions (..., 3) of any length, t counts in units of |d|; a single ray gives numbers and (3,)
    vectors.  `threads`: default all cores; their number changes no bit.  Raises ValueError for
    arrays of other shapes and for what is not numbers, and SceneError for files that cannot be
    used.
    """

    def intersect(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        t_min: npt.ArrayLike = 0.0,
        t_max: npt.ArrayLike = math.inf,
        threads: int | None = None,
    ) -> query.Intersections:
        """What rays meet first at t_min < t < t_max, with points, normals and uv: see
        `reference_rt.query.intersect`."""
        return query.intersect(self.tables, origins, directions, t_min, t_max, threads)

    def first_hits(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        t_min: npt.ArrayLike = 0.0,
        t_max: npt.ArrayLike = math.inf,
        threads: int | None = None,
    ) -> query.Hits:
        """The same without points, normals and uv, in less time."""
        return query.first_hits(self.tables, origins, directions, t_min, t_max, threads)

    def occluded(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        t_max: npt.ArrayLike = math.inf,
        t_min: npt.ArrayLike = 0.0,
        threads: int | None = None,
    ) -> npt.NDArray[np.bool_]:
        """Whether anything lies on each ray at t_min < t < t_max."""
        return query.occluded(self.tables, origins, directions, t_max, threads, t_min)

    def crossings(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        t_min: npt.ArrayLike = 0.0,
        t_max: npt.ArrayLike = math.inf,
        threads: int | None = None,
    ) -> query.Crossings:
        """All crossings of each ray with the surfaces of all shapes, in order: see
        `reference_rt.rendering.query.crossings`."""
        return query.crossings(self.tables, origins, directions, t_min, t_max, threads)

    def camera_rays(
        self,
        pixels: npt.ArrayLike | None = None,
        offsets: npt.ArrayLike = (0.0, 0.0),
        lens: npt.ArrayLike = (0.5, 0.5),
        threads: int | None = None,
    ) -> query.CameraRays:
        """The camera's rays through pixels, of all (height, width) where none are given: see
        `reference_rt.query.camera_rays`."""
        return query.camera_rays(self, pixels, offsets, lens, threads)

    def radiance(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        spp: int | None = None,
        seed: int = 0,
        integrator: AnyIntegrator | None = None,
        threads: int | None = None,
    ) -> query.Radiance:
        """The radiance along rays, by the scene's integrator or another, and its standard error:
        see `reference_rt.rendering.query.radiance`."""
        return query.radiance(self, origins, directions, spp, seed, integrator, threads)

    def bsdf(self, material: str | None) -> query.Bsdf:
        """What a material scatters, to be evaluated and sampled: see `reference_rt.query.Bsdf`."""
        return query.Bsdf(self, material)

    def light_sources(self) -> query.LightSources:
        """What the numbers of lights mean: see `reference_rt.query.LightSources`."""
        return query.light_sources(self)

    def sample_lights(
        self,
        points: npt.ArrayLike,
        u: npt.ArrayLike,
        normals: npt.ArrayLike = (0.0, 0.0, 0.0),
        threads: int | None = None,
    ) -> query.LightSamples:
        """A light, and a direction towards it, for each point: see
        `reference_rt.query.sample_lights`."""
        return query.sample_lights(self.tables, points, u, normals, threads)

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
        return query.light_pdf(self.tables, points, directions, normals, t_min, threads)

"""`Scene`: the description of a scene, with array queries as methods."""

import functools
import math
from collections.abc import Callable
from typing import ClassVar, Concatenate, ParamSpec, TypeVar

import numpy as np
import numpy.typing as npt

from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering import query
from reference_rt.rendering.picture import Picture
from reference_rt.rendering.render import render
from reference_rt.scene.build import BuiltScene

P = ParamSpec("P")
R = TypeVar("R")


def _of_tables(
    function: Callable[Concatenate[SceneTables, P], R],
) -> Callable[Concatenate["Scene", P], R]:
    """A query of a scene's tables, as a method of `Scene` with the same parameters."""

    @functools.wraps(function)
    def method(scene: "Scene", /, *args: P.args, **kwargs: P.kwargs) -> R:
        return function(scene.tables, *args, **kwargs)

    return method


class Scene(BuiltScene):
    """Everything that determines a picture.  Right-handed world; linear sRGB; scene units.

    The methods are array queries.  Arrays broadcast; rays are origins (..., 3) and directions
    (..., 3) of any length, with t in units of |d|; a single ray gives numbers and (3,) vectors.
    `threads`: default all cores; their number changes no bit.  Raises ValueError for arrays of
    other shapes and for arrays that are not numeric, and SceneError for unusable files.  Each
    method has the parameters and the documentation of the function of `reference_rt.query`.
    """

    intersect: ClassVar = _of_tables(query.intersect)
    """The first hit of each ray at t_min < t < t_max, with points, normals and uv."""

    first_hits: ClassVar = _of_tables(query.first_hits)
    """`intersect` without points, normals and uv, in less time."""

    crossings: ClassVar = _of_tables(query.crossings)
    """All crossings of each ray with the surfaces of all shapes, in order."""

    camera_rays: ClassVar = query.camera_rays
    """The camera's rays through pixels; by default all (height, width)."""

    radiance: ClassVar = query.radiance
    """The radiance along rays by an integrator, default the scene's own, and its standard error."""

    light_sources: ClassVar = query.light_sources
    """The shape or light of the scene that each light number stands for."""

    sample_lights: ClassVar = _of_tables(query.sample_lights)
    """A randomly selected light, and a direction towards it, for each point."""

    light_pdf: ClassVar = _of_tables(query.light_pdf)
    """The density with which `sample_lights` draws directions."""

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

    def bsdf(self, material: str | None) -> query.Bsdf:
        """The BSDF of a material, to evaluate and sample: see `reference_rt.query.Bsdf`."""
        return query.Bsdf(self, material)

    def preview(self, width: int = 320, spp: int = 16) -> Picture:
        """A small picture of the scene, of its own aspect ratio.  width: in pixels;  spp: at most
        so many samples per pixel."""
        height = max(1, round(self.film.height * width / self.film.width))
        spp = min(spp, self.resolved_sampler.spp)
        return render(self, size=(width, height), spp=spp)

    def _repr_png_(self) -> bytes:
        """The preview, for notebooks."""
        return self.preview().png()

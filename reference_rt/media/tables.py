"""The media of a scene as kernels take them; which of them is on which side of a surface."""

from typing import NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import SurfacePoint
from reference_rt.core.vec3 import Vec3, dot
from reference_rt.jit.kernel import kernel
from reference_rt.media.homogeneous import Homogeneous
from reference_rt.media.phase import Lobe, Lobes

VACUUM = -1
"""In place of the number of a medium."""

UNCHANGED = -2
"""In place of the number of a medium: that in which the ray arrives."""


class Media(NamedTuple):
    """The k media of a scene, and its n materials as boundaries of them.

    sigma_t (k, 3), in 1 / scene unit;  scattered (k, 3), sigma_t times albedo;  scatters (k,):
    whether any light is scattered, not only absorbed;  lobes: of the phase functions;  is_grey:
    whether no medium that scatters has another sigma_t for another colour.
    inside, outside (n,): the medium behind and in front of a surface with this material: its
    number, VACUUM, or UNCHANGED for a surface that bounds none;  passes (n,): whether there is no
    surface, so that rays go straight on;  any_passes: whether there is such a material.
    """

    sigma_t: FloatArray
    scattered: FloatArray
    scatters: IntArray
    lobes: Lobes
    is_grey: int
    inside: IntArray
    outside: IntArray
    passes: IntArray
    any_passes: int


def media_table(
    media: list[Homogeneous], sides: list[tuple[int, int]], passes: list[bool]
) -> Media:
    """sides: inside and outside of each material;  passes: whether it is no surface."""
    sigma_t = np.array([medium.sigma_t for medium in media]).reshape(-1, 3)
    sigma_t = sigma_t * np.array([medium.scale for medium in media])[:, None]
    scattered = sigma_t * np.array([medium.albedo for medium in media]).reshape(-1, 3)
    scatters = scattered.any(axis=1)
    lobes: list[Lobe] = [lobe for medium in media for lobe in medium.phase.lobes]
    counts = [len(medium.phase.lobes) for medium in media]
    inside, outside = np.array(sides, np.int64).reshape(-1, 2).T
    return Media(
        sigma_t=np.ascontiguousarray(sigma_t),
        scattered=np.ascontiguousarray(scattered),
        scatters=scatters.astype(np.int64),
        lobes=Lobes(
            share=np.array([lobe.share for lobe in lobes], np.float64),
            g=np.array([lobe.g for lobe in lobes], np.float64),
            code=np.array([lobe.code for lobe in lobes], np.int64),
            first=np.cumsum([0, *counts]),
        ),
        is_grey=int((np.ptp(sigma_t, axis=1) == 0.0)[scatters].all()),
        inside=np.ascontiguousarray(inside),
        outside=np.ascontiguousarray(outside),
        passes=np.array(passes, np.int64),
        any_passes=int(any(passes)),
    )


@kernel
def medium_beyond(media: Media, point: SurfacePoint, d: Vec3, medium: int) -> int:
    """The medium in which a ray goes on along d from a surface at which it arrives in `medium`."""
    inside, outside = media.inside[point.material], media.outside[point.material]
    if inside == UNCHANGED:
        return medium
    return int(inside if dot(d, point.n) < 0.0 else outside)


@kernel
def thickness(sigma: float, t: float) -> float:
    """The optical thickness of a distance t, which may be infinite."""
    if sigma == 0.0:
        return 0.0
    return sigma * t

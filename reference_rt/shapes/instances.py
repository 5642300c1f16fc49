"""Instances: copies of a group of shapes, which is stored once, each under its own map."""

from pathlib import Path
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.model import Examples
from reference_rt.core.ray import Ray, SurfacePoint
from reference_rt.core.transform import FLAT, affine, flattens, singular
from reference_rt.core.vec3 import length, normalize
from reference_rt.jit.kernel import kernel
from reference_rt.shapes.placement import (
    local_ray,
    world_covector,
    world_error,
    world_point,
    world_vector,
)
from reference_rt.shapes.shape import Shape, Tangents
from reference_rt.util.files import open_input


class Instance(Shape):
    """A copy of a group's shapes, which are stored once, under a transform; or many copies."""

    EXAMPLES: ClassVar[Examples] = ({"group": "group"}, {"group": "group", "file": "copies.npy"})
    type: Literal["instance"] = "instance"
    group: str
    """Name of the group in the scene's `groups`."""
    file: str | None = None
    """A NumPy file, .npy, relative to the scene file, with the affine matrices of n copies: (n, 3,
    4), or (n, 4, 4) with the last rows 0 0 0 1.  Each is applied before `transform`.  Default: one
    copy, under `transform` alone."""

    def maps(self, folder: Path) -> FloatArray:
        """The maps (n, 3, 4) of its copies;  folder: of the scene.  Raises ValueError for a file
        that cannot be used, and for maps that flatten space."""
        own = affine(self.transform)
        if self.file is None:
            if flattens(own):
                raise ValueError(FLAT)
            return own[None]
        maps = composed(_read(folder / self.file), own[None])
        if (flat := singular(maps)).any():
            raise ValueError(f"matrix {flat.argmax()}: {FLAT}")
        return maps


def composed(maps: FloatArray, outer: FloatArray) -> FloatArray:
    """The compositions (n k, 3, 4) of the maps (k, 3, 4), each followed by the first of `outer`
    (n, 3, 4), then of all followed by the second, and so on."""
    result = np.empty((len(outer), *maps.shape))
    result[..., :3] = outer[:, None, :, :3] @ maps[:, :, :3]
    result[..., 3] = maps[:, :, 3] @ outer[:, :, :3].swapaxes(1, 2) + outer[:, None, :, 3]
    return result.reshape(-1, 3, 4)


def _read(path: Path) -> FloatArray:
    """The matrices (n, 3, 4) of a file."""
    expected = "expected a .npy file of matrices (n, 3, 4) or (n, 4, 4)"
    try:
        with open_input(path) as file:
            found = np.lib.format.read_array(file, allow_pickle=False)
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}; {expected}") from None
    except Exception as error:  # a damaged file makes NumPy raise almost anything
        reason = " ".join(str(error).split())
        raise ValueError(f"{path}: cannot be read: {reason}; {expected}") from None
    if found.ndim != 3 or found.shape[1:] not in ((3, 4), (4, 4)) or found.dtype.kind not in "fiu":
        raise ValueError(f"{path}: has {found.dtype} {found.shape}; {expected}")
    if not len(found):
        raise ValueError(f"{path}: has no matrices; expected at least one")
    if found.shape[1] == 4 and np.any(found[:, 3] != (0, 0, 0, 1)):
        raise ValueError(f"{path}: expected affine matrices, whose last rows are 0 0 0 1")
    return np.asarray(found[:, :3], np.float64)


class Instances(NamedTuple):
    """n instances: center (n, 3), to_local (n, 9) and edges (n, 9), see `shapes.placement`; root
    (n,), the root of the BVH over the group's shapes; owner (n,), the shape id in the scene; copy
    (n,), the number of the copy, since a group that contains instances has many of one shape id."""

    center: FloatArray
    to_local: FloatArray
    edges: FloatArray
    root: IntArray
    owner: IntArray
    copy: IntArray


@kernel
def ray_in(instances: Instances | None, i: int, ray: Ray) -> Ray:
    """The ray in the coordinates of the group of instance i; unchanged for i = -1."""
    if instances is None:
        return ray
    if i < 0:
        return ray
    return local_ray(instances, i, ray)


@kernel
def out_of(instances: Instances | None, i: int, point: SurfacePoint) -> SurfacePoint:
    """A point of a group's surface, in the world; unchanged for i = -1."""
    if instances is None:
        return point
    if i < 0:
        return point
    p = world_point(instances, i, point.p)
    covector = world_covector(instances, i, point.n)
    covector_length = length(covector)
    error = world_error(instances, i, p, point.p, point.n, covector_length, point.error)
    return SurfacePoint(
        p,
        covector * (1.0 / covector_length),
        normalize(world_covector(instances, i, point.ns)),
        error,
        point.material,
        point.light,
    )


@kernel
def tangents_out_of(instances: Instances | None, i: int, tangents: Tangents) -> Tangents:
    """Tangents to a group's surface, in the world; unchanged for i = -1."""
    if instances is None:
        return tangents
    if i < 0:
        return tangents
    return Tangents(
        world_vector(instances, i, tangents.dpdu), world_vector(instances, i, tangents.dpdv)
    )

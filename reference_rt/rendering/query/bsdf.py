"""The BSDF of a material, evaluated and sampled in the shading frame of a surface."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt import materials as any_material
from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import SurfacePoint, scaled
from reference_rt.core.vec3 import Frame, Vec3, normalize, row
from reference_rt.jit.kernel import entry_kernel, kernel, local_floats
from reference_rt.jit.links import Linker
from reference_rt.materials import Materials, Shading, scratch_floats
from reference_rt.materials.textured import evaluate_textures, lookup_cache_size
from reference_rt.rendering.kept_links import Linked, linked
from reference_rt.rendering.linking import calls_of, linked_materials, linked_textures
from reference_rt.rendering.query.hits import BoolArray
from reference_rt.rendering.query.rays import (
    broadcast,
    check_in_unit_cube,
    in_blocks,
    numbers,
    shaped,
)
from reference_rt.scene.build import BuiltScene
from reference_rt.scene.model import no_such
from reference_rt.shapes import Sphere
from reference_rt.shapes.shape import Tangents
from reference_rt.textures import NOWHERE, At, Textures
from reference_rt.util.errors import Brief, SceneError


@dataclass(frozen=True)
class BsdfSamples(metaclass=Brief):
    """Directions that BSDF sampling draws for `wo`.

    wi (..., 3): unit directions;  weight (..., 3): f(wo, wi) |cos wi| / pdf;  pdf (...): density
    per solid angle, 0 if nothing is scattered;  eta (...): index of refraction on wi's side over
    that on wo's side, 1 for reflection;  is_delta (...): whether wi is from a delta lobe (mirrored,
    refracted, transmitted straight on): pdf is then its probability.
    """

    wi: FloatArray
    weight: FloatArray
    pdf: FloatArray
    eta: FloatArray
    is_delta: BoolArray


@kernel
def _shading(
    materials: Materials, textures: Textures | None, m: int, wo: Vec3, at: FloatArray,
    kept: FloatArray,
) -> Shading:  # fmt: skip
    """A point whose shading frame is the world's.  at (11,): u, v, colour, dp/du, dp/dv."""
    zero, z = Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 1.0)
    frame = Frame(Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), z)
    tangents = Tangents(Vec3(at[5], at[6], at[7]), Vec3(at[8], at[9], at[10]))
    place = At(textures, at[0], at[1], Vec3(at[2], at[3], at[4]), NOWHERE)
    looked = evaluate_textures(materials.textured, m, place, kept)
    point = SurfacePoint(zero, z, z, 0.0, m, -1)
    flat_leaves = kept[lookup_cache_size(materials.textured) :]
    shading = Shading(point, frame, wo, looked, tangents, flat_leaves)
    any_material.prepare(materials, shading, place)
    return shading


@entry_kernel
def scatter_kernel(
    materials: Materials,
    textures: Textures | None,
    m: int,
    wo: FloatArray,
    wi: FloatArray,
    u: FloatArray,
    at: FloatArray,
    out: FloatArray,
) -> None:
    """Evaluate, if u is `NOTHING`: value and density towards wi, into out (n, 4).  Or sample with
    u: wi, weight, pdf, eta and is_delta, into out (n, 9)."""
    kept = local_floats(scratch_floats(materials))
    origin = Vec3(0.0, 0.0, 0.0)
    for i in range(len(wo)):
        for k in range(out.shape[1]):
            out[i, k] = 0.0
        back, _, seen = scaled(origin, row(wo, i), math.inf)
        if not seen:
            continue
        shading = _shading(materials, textures, m, normalize(back.d), at[i], kept)
        if len(u) == 0:
            forth, _, valid = scaled(origin, row(wi, i), math.inf)
            if valid:
                eval_pdf = any_material.eval_pdf(materials, shading, normalize(forth.d))
                out[i, 0], out[i, 1], out[i, 2] = eval_pdf.value
                out[i, 3] = eval_pdf.density
            continue
        drawn = any_material.sample(materials, shading, u[i, 0], u[i, 1], u[i, 2])
        out[i, 7] = 1.0
        if drawn.pdf > 0.0:
            out[i, 0], out[i, 1], out[i, 2] = drawn.wi
            out[i, 3], out[i, 4], out[i, 5] = drawn.weight
            out[i, 6], out[i, 7] = drawn.pdf, drawn.eta
            out[i, 8] = 1.0 if drawn.is_delta else 0.0


NOTHING = np.empty((0, 3))
"""In place of wi or u."""


class Bsdf(metaclass=Brief):
    """The BSDF of one material of a scene, leaf or nested.

    Directions are in the shading frame (z along the shading normal, x along dp/du) and point away
    from the surface: `wo` towards the viewer, `wi` towards the light.  (Mitsuba swaps the two
    names.)  They may have any length; for one that is 0 or not finite the value is 0.  Values are
    for radiance, not importance: radiance that enters glass of index eta is multiplied by 1 / eta².

    Every method takes the place on the surface: `uv` (..., 2) for textures; `colour` (..., 3), the
    interpolated vertex colour of a mesh, negative for none; `dpdu` and `dpdv` (..., 3), the
    derivatives of the point, for bump and normal maps.  All arrays broadcast; single directions
    give numbers.  Raises ValueError for arrays of other shapes.
    """

    def __init__(self, scene: BuiltScene, name: str | None) -> None:
        """The BSDF of material `name`; None: the default material, of shapes that have none.
        Raises SceneError if the scene has no such material."""
        if name is None:
            scene, number = BuiltScene(shapes=(Sphere(),)), 0
        elif name in scene.materials:
            number = list(scene.materials).index(name)
        else:
            raise SceneError(no_such("material", name, scene.materials))
        self._tables, self._number = scene.tables, number

    def _linked(self) -> Linked:
        """(materials, textures)."""
        materials, textures = self._tables.materials, self._tables.textures

        def link(linker: Linker) -> Any:
            calls = calls_of(scatter_kernel)
            of_materials = linked_materials(linker, materials, calls)
            return of_materials, linked_textures(linker, textures, calls)

        return linked(self._tables, "bsdf", link)

    def evaluate(
        self,
        wo: npt.ArrayLike,
        wi: npt.ArrayLike,
        uv: npt.ArrayLike = (0.0, 0.0),
        colour: npt.ArrayLike = (-1.0, -1.0, -1.0),
        dpdu: npt.ArrayLike = (1.0, 0.0, 0.0),
        dpdv: npt.ArrayLike = (0.0, 1.0, 0.0),
        threads: int | None = None,
    ) -> FloatArray:
        """f(wo, wi) |cos wi| (..., 3), the cosine included, without delta lobes: these have no
        finite value, and only `sample` draws them."""
        out, shape = self._scatter(wo, wi, None, (uv, colour, dpdu, dpdv), threads)
        return shaped(out[:, :3], shape)  # type: ignore[no-any-return]

    def pdf(
        self,
        wo: npt.ArrayLike,
        wi: npt.ArrayLike,
        uv: npt.ArrayLike = (0.0, 0.0),
        colour: npt.ArrayLike = (-1.0, -1.0, -1.0),
        dpdu: npt.ArrayLike = (1.0, 0.0, 0.0),
        dpdv: npt.ArrayLike = (0.0, 1.0, 0.0),
        threads: int | None = None,
    ) -> FloatArray:
        """The density per solid angle (...) with which `sample` draws wi, without delta lobes: if
        the material has any, the density integrates to less than 1."""
        out, shape = self._scatter(wo, wi, None, (uv, colour, dpdu, dpdv), threads)
        return shaped(out[:, 3], shape)  # type: ignore[no-any-return]

    def sample(
        self,
        wo: npt.ArrayLike,
        u: npt.ArrayLike,
        uv: npt.ArrayLike = (0.0, 0.0),
        colour: npt.ArrayLike = (-1.0, -1.0, -1.0),
        dpdu: npt.ArrayLike = (1.0, 0.0, 0.0),
        dpdv: npt.ArrayLike = (0.0, 1.0, 0.0),
        threads: int | None = None,
    ) -> BsdfSamples:
        """A direction drawn for wo.  u (..., 3): numbers in [0, 1), the first selects the lobe, the
        other two the direction in it."""
        out, shape = self._scatter(wo, None, u, (uv, colour, dpdu, dpdv), threads)
        columns = (out[:, 0:3], out[:, 3:6], out[:, 6], out[:, 7], out[:, 8] != 0.0)
        return BsdfSamples(*(shaped(column, shape) for column in columns))

    def _scatter(
        self,
        wo: npt.ArrayLike,
        wi: npt.ArrayLike | None,
        u: npt.ArrayLike | None,
        place: tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike, npt.ArrayLike],
        threads: int | None,
    ) -> tuple[FloatArray, tuple[int, ...]]:
        second, name = (wi, "wi") if u is None else (u, "u")
        assert second is not None
        arrays = [("wo", numbers("wo", wo, 3), 1), (name, numbers(name, second, 3), 1)]
        sizes = (("uv", 2), ("colour", 3), ("dpdu", 3), ("dpdv", 3))
        for (label, size), values in zip(sizes, place, strict=True):
            arrays.append((label, numbers(label, values, size), 1))
        shape, (back, other, *at) = broadcast(*arrays)
        if u is not None:
            check_in_unit_cube(other)
        where = np.concatenate(at, axis=1)
        out = np.empty((len(back), 4 if u is None else 9))
        found = self._linked()

        def scatter(k: slice) -> None:
            wi_of, u_of = (other[k], NOTHING) if u is None else (NOTHING, other[k])
            materials, textures = found.tables
            scatter_kernel(
                materials, textures, self._number, back[k], wi_of, u_of, where[k], out[k]
            )

        in_blocks(scatter, len(back), threads)
        return out, shape

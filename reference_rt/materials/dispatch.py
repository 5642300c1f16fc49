"""The materials of a scene: evaluate, sample and pdf, of one BSDF or of several layers.

Directions are in the shading frame; `shading.wo` points to the viewer.  m is a material's number.
A material that is made of others (mask, blend, bump, ...) is a list of layers, each a BSDF with a
weight and a frame (`nested/flattened.py`).
"""

from typing import NamedTuple

from reference_rt.core.arrays import IntArray
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel
from reference_rt.jit.links import is_absent
from reference_rt.materials.bsdfs import dispatch as bsdf
from reference_rt.materials.bsdfs.tables import Leaves
from reference_rt.materials.material import Branches, BsdfSample, Scattered, Shading
from reference_rt.materials.nested import flattened
from reference_rt.materials.nested.flattened import (
    FlattenedMaterials,
    ambient_nested,
    branches_nested,
    eval_pdf_nested,
    leaf_count,
    sample_nested,
)
from reference_rt.materials.textured import Textured, lookup_cache_size
from reference_rt.textures import At, Colours


class Materials(NamedTuple):
    """The n materials of a scene.  None stands for an array that the scene does not need.

    kind (n,), row (n,): the table and row of a material's BSDF, without layers; kind is None if
    there is only one table, row is None too if material m is row m of it.
    smooth (n,): whether lights can be sampled; None if all are smooth.
    uses_u_lobe (n,): whether `sample` uses `u_lobe`; None if none does.
    behind (n,): whether light from both sides of the surface counts; None if it never does.
    shown (n): the colour for ray casting.
    oriented (n,): whether it is anisotropic, or tilted by a texture; None if none is.
    asks (n,): whether a texture is used; None if all or none use one.
    textured: None if no colour is textured.
    flat_leaves: None if no material is made of others.
    leaves: the tables of BSDFs.
    """

    kind: IntArray | None
    row: IntArray | None
    smooth: IntArray | None
    uses_u_lobe: IntArray | None
    behind: IntArray | None
    shown: Colours
    oriented: IntArray | None
    asks: IntArray | None
    textured: Textured | None
    flat_leaves: FlattenedMaterials | None
    leaves: Leaves


def any_smooth(materials: Materials) -> bool:
    """Whether there is any material for which lights can be sampled."""
    return materials.smooth is None or bool(materials.smooth.any())


@kernel
def _flag(flags: IntArray | None, m: int, of_all: bool) -> bool:
    if flags is None:
        return of_all
    return bool(flags[m] != 0)


@kernel
def _kind(kinds: IntArray | None, materials: Materials, m: int) -> int:
    if kinds is None:
        return bsdf.only(materials.leaves)
    return int(kinds[m])


@kernel
def _row(rows: IntArray | None, m: int) -> int:
    if rows is None:
        return m
    return int(rows[m])


@kernel
def is_smooth(materials: Materials, m: int) -> bool:
    """Whether lights can be sampled: the material scatters into a continuum of directions."""
    return _flag(materials.smooth, m, True)


@kernel
def uses_u_lobe(materials: Materials, m: int) -> bool:
    """Whether `sample` uses `u_lobe`, its random number for the choice of a lobe."""
    return _flag(materials.uses_u_lobe, m, False)


@kernel
def uses_textures(materials: Materials, m: int) -> bool:
    """Whether the material has textures, so that texture coordinates are needed."""
    return _flag(materials.asks, m, True)


@kernel
def takes_light_from_behind(materials: Materials, m: int) -> bool:
    """Whether light from both sides of the surface may reach the viewer."""
    return _flag(materials.behind, m, False)


@kernel
def is_oriented(materials: Materials, m: int) -> bool:
    """Whether what the material scatters depends on the directions of dp/du and dp/dv."""
    return _flag(materials.oriented, m, False)


@kernel
def any_transmits(materials: Materials) -> bool:
    """Whether any material transmits light: a constant."""
    return materials.behind is not None


@kernel
def evaluate(materials: Materials, shading: Shading, wi: Vec3) -> Vec3:
    """f(wo, wi) |cos wi|, without perfect reflection and refraction."""
    return eval_pdf(materials, shading, wi).value


@kernel
def pdf(materials: Materials, shading: Shading, wi: Vec3) -> float:
    """The density per solid angle with which `sample` picks `wi`, without discrete directions."""
    return eval_pdf(materials, shading, wi).density


@kernel
def eval_pdf(materials: Materials, shading: Shading, wi: Vec3) -> Scattered:
    """`evaluate` and `pdf` at once, which share much of their work."""
    m = shading.point.material
    if materials.flat_leaves is None:
        kind, i = _kind(materials.kind, materials, m), _row(materials.row, m)
        return bsdf.eval_pdf(materials.leaves, kind, i, shading.at, shading.wo, wi)
    if is_absent(materials.flat_leaves):
        kind, i = _kind(materials.kind, materials, m), _row(materials.row, m)
        return bsdf.eval_pdf(materials.leaves, kind, i, shading.at, shading.wo, wi)
    return eval_pdf_nested(materials.flat_leaves, materials.leaves, shading, wi)


@kernel
def sample(
    materials: Materials, shading: Shading, u_lobe: float, u0: float, u1: float
) -> BsdfSample:
    """A direction sampled for `shading.wo`; pdf = 0 if the material scatters nothing."""
    m = shading.point.material
    if materials.flat_leaves is None:
        kind, i = _kind(materials.kind, materials, m), _row(materials.row, m)
        return bsdf.sample(materials.leaves, kind, i, shading.at, shading.wo, u_lobe, u0, u1)
    if is_absent(materials.flat_leaves):
        kind, i = _kind(materials.kind, materials, m), _row(materials.row, m)
        return bsdf.sample(materials.leaves, kind, i, shading.at, shading.wo, u_lobe, u0, u1)
    return sample_nested(materials.flat_leaves, materials.leaves, shading, u_lobe, u0, u1)


@kernel
def branch_count(materials: Materials, m: int) -> int:
    """The number of `branches` of a material."""
    if materials.flat_leaves is None:
        return 1
    if is_absent(materials.flat_leaves):
        return 1
    return leaf_count(materials.flat_leaves, m)


@kernel
def most_branches(materials: Materials) -> int:
    """The largest `branch_count`."""
    return max(1, flattened.most(materials.flat_leaves))


@kernel
def scratch_floats(materials: Materials) -> int:
    """The size of the scratch buffer that `shade` needs for this scene's materials."""
    flat_leaves = flattened.SIZE * flattened.most(materials.flat_leaves)
    return lookup_cache_size(materials.textured) + flat_leaves


@kernel
def prepare(materials: Materials, shading: Shading, at: At) -> None:
    """Write `shading.flat_leaves`, which all other functions need.  `at`: the place for textures
    whose lookups are not cached."""
    flattened.prepare(materials.flat_leaves, shading, at)


@kernel
def ambient(materials: Materials, shading: Shading) -> Vec3:
    """The ambient reflectance k_a of the Phong model, summed over the layers; black for others."""
    m = shading.point.material
    if materials.flat_leaves is None:
        kind, i = _kind(materials.kind, materials, m), _row(materials.row, m)
        return bsdf.ambient(materials.leaves, kind, i, shading.at)
    if is_absent(materials.flat_leaves):
        kind, i = _kind(materials.kind, materials, m), _row(materials.row, m)
        return bsdf.ambient(materials.leaves, kind, i, shading.at)
    return ambient_nested(materials.flat_leaves, materials.leaves, shading)


@kernel
def branches(materials: Materials, shading: Shading, k: int) -> Branches:
    """The perfectly reflected and refracted directions of layer k of a material."""
    m = shading.point.material
    if materials.flat_leaves is None:
        kind, i = _kind(materials.kind, materials, m), _row(materials.row, m)
        return bsdf.branches(materials.leaves, kind, i, shading.at, shading.wo)
    if is_absent(materials.flat_leaves):
        kind, i = _kind(materials.kind, materials, m), _row(materials.row, m)
        return bsdf.branches(materials.leaves, kind, i, shading.at, shading.wo)
    return branches_nested(materials.flat_leaves, materials.leaves, shading, k)

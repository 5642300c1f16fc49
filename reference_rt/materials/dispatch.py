"""The materials of a scene: evaluate, sample and pdf, of one BSDF or of several layers.

Directions are in the shading frame; `shading.wo` points to the viewer.  m is a material's number.
A material that is made of others (mask, blend, bump, ...) is a list of layers, each a BSDF with a
weight and a frame (`nested/flattened.py`).
"""

from typing import Any, NamedTuple

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import PointBlock, RayBlock
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel
from reference_rt.jit.links import is_absent
from reference_rt.materials.bsdfs import dispatch as bsdf
from reference_rt.materials.material import Branches, BsdfSample, ScatterBlock, Scattered, Shading
from reference_rt.materials.nested import flattened
from reference_rt.materials.nested.flattened import (
    ambient_nested,
    branches_nested,
    eval_pdf_nested,
    leaf_count,
    sample_nested,
)
from reference_rt.materials.textured import Textured, lookup_cache_size
from reference_rt.textures import At, Colours, Textures


class Materials(NamedTuple):
    """The n materials of a scene.

    kind (n,), row (n,): the table and row of a material's BSDF, without layers;
    smooth (n,): whether lights can be sampled: the material scatters into a continuum of
    directions;
    uses_u_lobe (n,): whether `sample` uses `u_lobe`, its random number for the choice of a lobe;
    behind (n,): whether light from both sides of the surface may reach the viewer;
    shown (n): the colour for ray casting;
    oriented (n,): whether what it scatters depends on the directions of dp/du and dp/dv: it is
    anisotropic, or tilted by a texture;
    asks (n,): whether a texture is used, so that texture coordinates are needed;
    textured: which ones;
    flat_leaves: of materials that are made of others, None if there are none, or a link;
    leaves: the tables of BSDFs, or a link.
    """

    kind: IntArray
    row: IntArray
    smooth: IntArray
    uses_u_lobe: IntArray
    behind: IntArray
    shown: Colours
    oriented: IntArray
    asks: IntArray
    textured: Textured
    flat_leaves: Any
    leaves: Any


@kernel
def is_smooth(materials: Materials, m: int) -> bool:
    return bool(materials.smooth[m] != 0)


@kernel
def uses_u_lobe(materials: Materials, m: int) -> bool:
    return bool(materials.uses_u_lobe[m] != 0)


@kernel
def uses_textures(materials: Materials, m: int) -> bool:
    return bool(materials.asks[m] != 0)


@kernel
def takes_light_from_behind(materials: Materials, m: int) -> bool:
    return bool(materials.behind[m] != 0)


@kernel
def is_oriented(materials: Materials, m: int) -> bool:
    return bool(materials.oriented[m] != 0)


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
    if is_absent(materials.flat_leaves):
        kind, i = materials.kind[m], materials.row[m]
        return bsdf.eval_pdf(materials.leaves, kind, i, shading.at, shading.wo, wi)
    return eval_pdf_nested(materials.flat_leaves, materials.leaves, shading, wi)


@kernel
def are_flattened(materials: Materials) -> bool:
    """Whether any material is made of others: then all are lists of layers."""
    return not is_absent(materials.flat_leaves)


@kernel
def scatters(materials: Materials, m: int) -> bool:
    """Whether a material that is no list of layers scatters anything."""
    return bool(materials.kind[m] < bsdf.KINDS)


@kernel
def scatter(
    materials: Materials,
    block: ScatterBlock,
    rays: RayBlock,
    points: PointBlock,
    light: FloatArray,
    textures: Textures | None,
    kept: FloatArray,
    n: int,
) -> None:
    """`eval_pdf` towards the light samples, and `sample`, for those of the first n paths for which
    this is asked (`put_asked`), of materials that are no lists of layers.  Read it with `lit_in`
    and `drawn_in`.  light: see `direction_towards`."""
    leaves, textured = materials.leaves, materials.textured
    for kind in range(bsdf.KINDS):
        bsdf.scatter(leaves, kind, block, rays, points, light, textured, textures, kept, n)


@kernel
def sample(
    materials: Materials, shading: Shading, u_lobe: float, u0: float, u1: float
) -> BsdfSample:
    """A direction sampled for `shading.wo`; pdf = 0 if the material scatters nothing."""
    m = shading.point.material
    if is_absent(materials.flat_leaves):
        kind, i = materials.kind[m], materials.row[m]
        return bsdf.sample(materials.leaves, kind, i, shading.at, shading.wo, u_lobe, u0, u1)
    return sample_nested(materials.flat_leaves, materials.leaves, shading, u_lobe, u0, u1)


@kernel
def branch_count(materials: Materials, m: int) -> int:
    """The number of `branches` of a material."""
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
    if is_absent(materials.flat_leaves):
        kind, i = materials.kind[m], materials.row[m]
        return bsdf.ambient(materials.leaves, kind, i, shading.at)
    return ambient_nested(materials.flat_leaves, materials.leaves, shading)


@kernel
def branches(materials: Materials, shading: Shading, k: int) -> Branches:
    """The perfectly reflected and refracted directions of layer k of a material."""
    m = shading.point.material
    if is_absent(materials.flat_leaves):
        kind, i = materials.kind[m], materials.row[m]
        return bsdf.branches(materials.leaves, kind, i, shading.at, shading.wo)
    return branches_nested(materials.flat_leaves, materials.leaves, shading, k)

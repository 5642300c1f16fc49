"""What a material made of others scatters: the weighted sum of its flattened leaves."""

from reference_rt.core.vec3 import Vec3, to_local, to_world
from reference_rt.jit.kernel import kernel
from reference_rt.materials.bsdfs import tables as bsdf
from reference_rt.materials.bsdfs.tables import Leaves
from reference_rt.materials.material import NO_SAMPLE, Branches, BsdfSample, Scattered
from reference_rt.materials.nested.flattened import (
    FlattenedLeaf,
    FlattenedMaterials,
    flattened_materials,
    leaf_at,
    scatters_from,
    shadow_of,
)
from reference_rt.materials.shading import Shading


@flattened_materials.operation
def eval_pdf_nested(
    flat_leaves: FlattenedMaterials, leaves: Leaves, shading: Shading, wi: Vec3
) -> Scattered:
    """f(wo, wi) |cos wi| of all leaves, weighted, and the density of `sample_nested`."""
    m = shading.point.material
    value, density, total = Vec3(0.0, 0.0, 0.0), 0.0, 0.0
    first = flat_leaves.first[m]
    for k in range(flat_leaves.number[m]):
        leaf = leaf_at(shading, k)
        if leaf.weight > 0.0:
            total += leaf.weight
            wo_in, wi_in = to_local(leaf.basis, shading.wo), to_local(leaf.basis, wi)
            kind, i = flat_leaves.kind[first + k], flat_leaves.row[first + k]
            one = bsdf.eval_pdf(leaves, kind, i, shading.at, wo_in, wi_in)
            if scatters_from(leaf, wi):
                value = value + one.value * (leaf.weight * shadow_of(leaf, wi))
            elif flat_leaves.number[m] == 1:  # `sample` rejects such directions
                continue
            density += one.density * leaf.weight
    return Scattered(value, density / total if total > 0.0 else 0.0)


@flattened_materials.operation
def sample_nested(
    flat_leaves: FlattenedMaterials,
    leaves: Leaves,
    shading: Shading,
    u_lobe: float,
    u0: float,
    u1: float,
) -> BsdfSample:
    """A direction sampled from one of the leaves."""
    m = shading.point.material
    first, count = flat_leaves.first[m], flat_leaves.number[m]
    total = 0.0
    for k in range(count):
        total += leaf_at(shading, k).weight
    if not total > 0.0:
        return NO_SAMPLE
    # Choose a layer with probability weight / total; u_lobe, rescaled within the layer's interval,
    # is the random number for the layer's own choice.
    rest, chosen = u_lobe * total, 0
    leaf = leaf_at(shading, 0)
    while rest >= leaf.weight and chosen + 1 < count:
        rest -= leaf.weight
        chosen += 1
        leaf = leaf_at(shading, chosen)
    if not leaf.weight > 0.0:
        return NO_SAMPLE
    u_inner = min(rest / leaf.weight, 1.0 - 2.0**-53)
    wo_in = to_local(leaf.basis, shading.wo)
    kind, i = flat_leaves.kind[first + chosen], flat_leaves.row[first + chosen]
    drawn = bsdf.sample(leaves, kind, i, shading.at, wo_in, u_inner, u0, u1)
    wi = to_world(leaf.basis, drawn.wi)
    if drawn.pdf == 0.0:
        return NO_SAMPLE
    if drawn.is_delta or count == 1:
        if not scatters_from(leaf, wi):
            return NO_SAMPLE
    if drawn.is_delta:
        # weight / total is the probability of the layer, by which its contribution is divided.
        probability = drawn.pdf * (leaf.weight / total)
        weight = drawn.weight * (total * shadow_of(leaf, wi))
        return BsdfSample(wi, weight, probability, drawn.eta, True)
    if count == 1:
        weight = drawn.weight * (total * shadow_of(leaf, wi))
        return BsdfSample(wi, weight, drawn.pdf, drawn.eta, False)
    # Any of the layers could have sampled this direction: use the sum of their densities.
    found = eval_pdf_nested(flat_leaves, leaves, shading, wi)
    if not found.density > 0.0:
        return NO_SAMPLE
    return BsdfSample(wi, found.value * (1.0 / found.density), found.density, drawn.eta, False)


@flattened_materials.operation
def leaf_count(flat_leaves: FlattenedMaterials, m: int) -> int:
    """The number of leaves of material m."""
    return int(flat_leaves.number[m])


@flattened_materials.operation
def ambient_nested(flat_leaves: FlattenedMaterials, leaves: Leaves, shading: Shading) -> Vec3:
    """The ambient reflectance of all leaves, weighted."""
    m = shading.point.material
    total = Vec3(0.0, 0.0, 0.0)
    first = flat_leaves.first[m]
    for k in range(flat_leaves.number[m]):
        weight = leaf_at(shading, k).weight
        kind, i = flat_leaves.kind[first + k], flat_leaves.row[first + k]
        value = bsdf.ambient(leaves, kind, i, shading.at)
        total = total + value * weight
    return total


@flattened_materials.operation
def branches_nested(
    flat_leaves: FlattenedMaterials, leaves: Leaves, shading: Shading, k: int
) -> Branches:
    """The delta lobes of leaf k."""
    m = shading.point.material
    leaf = leaf_at(shading, k)
    k += flat_leaves.first[m]
    wo_in = to_local(leaf.basis, shading.wo)
    kind, i = flat_leaves.kind[k], flat_leaves.row[k]
    found = bsdf.branches(leaves, kind, i, shading.at, wo_in)
    reflected = to_world(leaf.basis, found.reflected)
    refracted = to_world(leaf.basis, found.refracted)
    return Branches(
        reflected,
        _let(leaf, reflected, found.reflectance),
        refracted,
        _let(leaf, refracted, found.transmittance),
        found.share,
        found.passing,
        found.eta,
    )


@kernel
def _let(leaf: FlattenedLeaf, wi: Vec3, factor: Vec3) -> Vec3:
    if not scatters_from(leaf, wi):
        return Vec3(0.0, 0.0, 0.0)
    return factor * (leaf.weight * shadow_of(leaf, wi))

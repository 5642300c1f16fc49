"""Flattened materials: lists of BSDF leaves, each with a weight and a frame, and their sum.

Masks, blends, two-sided materials, bump and normal maps may be nested in each other.  Each path
from such a material to a leaf (`paths.py`) becomes a flattened leaf: the leaf with the steps that
compute its weight and its frame at a hit.  What the material scatters is their weighted sum.
"""

from typing import Any, NamedTuple

import numpy as np

from reference_rt.core.arrays import IntArray
from reference_rt.core.vec3 import Frame, Vec3, to_local, to_world
from reference_rt.jit.kernel import kernel
from reference_rt.jit.links import Linkable, is_absent
from reference_rt.materials.bsdfs import dispatch as bsdf
from reference_rt.materials.bsdfs.tables import Leaves
from reference_rt.materials.material import (
    NO_SAMPLE,
    Branches,
    BsdfSample,
    Material,
    Scattered,
    Shading,
)
from reference_rt.materials.nested.paths import (
    BACK_ONLY,
    BUMP,
    FACE_VIEWER,
    FRONT_ONLY,
    ONE_MINUS_WEIGHT,
    WEIGHT,
    MaterialPath,
)
from reference_rt.materials.nested.tilted import (
    Bumps,
    NormalMaps,
    bump_basis,
    map_basis,
    shadowing,
    shadowing_alpha2,
)
from reference_rt.shapes.shape import Tangents
from reference_rt.textures import At, Numbers, OnTriangle, Palette, Textures, number_at
from reference_rt.textures.parameter import join


class FlattenedMaterials(NamedTuple):
    """For each material m: first (m,) and number (m,) of its flattened leaves.  For each of these,
    k: its table and row, kind (k,) and row (k,), and its steps, step_first (k,) and step_count
    (k,).  For each step s: its code, step (s,), and the row of its parameter, step_row (s,), in one
    of the tables that follow; a table is None if the scene has no such step."""

    first: IntArray
    number: IntArray
    kind: IntArray
    row: IntArray
    step_first: IntArray
    step_count: IntArray
    step: IntArray
    step_row: IntArray
    weights: Numbers | None
    bumps: Bumps | None
    normal_maps: NormalMaps | None


class FlattenedLeaf(NamedTuple):
    """A flattened leaf at a point.  weight: from 0 to 1;  basis: its frame, in coordinates of the
    shading frame;  side: 0 if its frame is not tilted by a bump or normal map, else 1, or -1 if it
    is flipped to the other side;  alpha2: of `tilted.shadowing`, 0 for none."""

    weight: float
    basis: Frame
    side: float
    alpha2: float


class FlattenedBuilder:
    """Collects the flattened leaves of a scene's materials."""

    def __init__(self, palette: Palette) -> None:
        self.palette = palette
        self.first: list[int] = []
        self.count: list[int] = []
        self.leaves: list[tuple[int, int]] = []
        self.step_counts: list[int] = []
        self.steps: list[tuple[int, int]] = []
        self.rows: dict[type, list[Any]] = {}

    def add(self, flat_leaves: list[tuple[MaterialPath, tuple[int, int]]]) -> None:
        """Adds the next material: its paths, with the (kind, row) of their leaves.

        Raises ValueError.
        """
        self.first.append(len(self.leaves))
        self.count.append(len(flat_leaves))
        for path, leaf in flat_leaves:
            self.leaves.append(leaf)
            self.step_counts.append(len(path.steps))
            self.steps += [(step.code, self._row(step.parameter)) for step in path.steps]

    def _row(self, parameter: Any) -> int:
        """Puts a step's parameter into its table; returns its row there."""
        if parameter is None:
            return -1
        if isinstance(parameter, Material):
            table = parameter.tabulate(self.palette)
        else:
            table = self.palette.numbers(parameter)
        rows = self.rows.setdefault(type(table), [])
        rows.append(table)
        return len(rows) - 1

    def tables(self) -> FlattenedMaterials | None:
        """None if no material is made of others."""
        if not self.steps:
            return None
        counts = np.array(self.step_counts)
        kind, row = zip(*self.leaves, strict=True)
        code, step_row = zip(*self.steps, strict=True)

        def table(cls: type) -> Any:
            return join(self.rows[cls]) if cls in self.rows else None

        return FlattenedMaterials(
            first=np.array(self.first),
            number=np.array(self.count),
            kind=np.array(kind),
            row=np.array(row),
            step_first=np.cumsum(counts) - counts,
            step_count=counts,
            step=np.array(code),
            step_row=np.array(step_row),
            weights=table(Numbers),
            bumps=table(Bumps),
            normal_maps=table(NormalMaps),
        )


SIZE = 12
"""Floats of a flattened leaf in the scratch buffer: weight, s, t and n of the basis, side, alpha2.
"""


flattened_materials = Linkable()
"""The operations on `FlattenedMaterials`, here and in `materials.dispatch`."""


@kernel
def most(flat_leaves: Any) -> int:
    """The largest number of flattened leaves of any material."""
    if is_absent(flat_leaves):
        return 0
    return _most(flat_leaves)


@flattened_materials.operation
def _most(flat_leaves: FlattenedMaterials) -> int:
    found = 0
    for m in range(len(flat_leaves.number)):
        found = max(found, flat_leaves.number[m])
    return found


@kernel
def prepare(flat_leaves: Any, shading: Shading, at: At) -> None:
    """Writes the flattened leaves of the material to the scratch buffer `shading.flat_leaves`.

    They depend on the point and on wo, not on wi: evaluated once per hit they serve all calls of
    `both`, `sample` and `branches`, and their code is compiled once.
    """
    if is_absent(flat_leaves):
        return
    textures: Any = at.textures
    on: Any = at.on
    _prepare(flat_leaves, shading, textures, at.u, at.v, at.colour, on)


@flattened_materials.operation
def _prepare(
    flat_leaves: FlattenedMaterials,
    shading: Shading,
    textures: Textures | None,
    u: float,
    v: float,
    colour: Vec3,
    on: OnTriangle,
) -> None:
    at = At(textures, u, v, colour, on)
    m = shading.point.material
    for k in range(flat_leaves.number[m]):
        found = _leaf_at_hit(flat_leaves, flat_leaves.first[m] + k, shading, at)
        buffer = shading.flat_leaves[SIZE * k : SIZE * (k + 1)]
        buffer[0], buffer[10], buffer[11] = found.weight, found.side, found.alpha2
        buffer[1], buffer[2], buffer[3] = found.basis.s
        buffer[4], buffer[5], buffer[6] = found.basis.t
        buffer[7], buffer[8], buffer[9] = found.basis.n


@kernel
def leaf_at(shading: Shading, k: int) -> FlattenedLeaf:
    """Flattened leaf k of the material, from the scratch buffer."""
    buffer = shading.flat_leaves[SIZE * k : SIZE * (k + 1)]
    basis = Frame(
        Vec3(buffer[1], buffer[2], buffer[3]),
        Vec3(buffer[4], buffer[5], buffer[6]),
        Vec3(buffer[7], buffer[8], buffer[9]),
    )
    return FlattenedLeaf(buffer[0], basis, buffer[10], buffer[11])


@kernel
def _leaf_at_hit(
    flat_leaves: FlattenedMaterials, k: int, shading: Shading, at: At
) -> FlattenedLeaf:
    """Runs the steps of flattened leaf k of the scene, for `shading.wo`."""
    weight, side, tilted, alpha2 = 1.0, 1.0, False, 0.0
    basis = Frame(Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 1.0))
    begin = flat_leaves.step_first[k]
    for s in range(begin, begin + flat_leaves.step_count[k]):
        code, i = flat_leaves.step[s], flat_leaves.step_row[s]
        above = to_local(basis, shading.wo).z > 0.0
        if code in (WEIGHT, ONE_MINUS_WEIGHT):
            w = _weight(flat_leaves.weights, i, shading)
            weight *= w if code == WEIGHT else 1.0 - w
        elif code == FRONT_ONLY:
            weight = weight if above else 0.0
        elif code == BACK_ONLY:
            weight = 0.0 if above else weight
        elif code == FACE_VIEWER:
            if not above:
                # As in Mitsuba z alone changes sign, so that the basis becomes left-handed.
                basis = Frame(basis.s, basis.t, -basis.n)
                side = -side
        else:
            tilted = True
            local = Tangents(
                to_local(basis, shading.tangents.dpdu), to_local(basis, shading.tangents.dpdv)
            )
            wo = to_local(basis, shading.wo)
            if code == BUMP:
                tilted_basis = _bumped(flat_leaves.bumps, i, at, local, wo)
                shadows = _shadows(flat_leaves.bumps, i)
            else:
                tilted_basis = _mapped(flat_leaves.normal_maps, i, shading, local, wo)
                shadows = _shadows(flat_leaves.normal_maps, i)
            if shadows:
                # Steps before this one may at most have flipped the frame: the angle that light
                # makes with its normal is that with the shading normal.
                alpha2 = shadowing_alpha2(tilted_basis.n)
            basis = Frame(
                to_world(basis, tilted_basis.s),
                to_world(basis, tilted_basis.t),
                to_world(basis, tilted_basis.n),
            )
    return FlattenedLeaf(weight, basis, side if tilted else 0.0, alpha2)


@kernel
def _weight(weights: Numbers | None, i: int, shading: Shading) -> float:
    if weights is None:
        return 1.0
    return min(1.0, number_at(weights, i, shading.at))


@kernel
def _identity() -> Frame:
    return Frame(Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 1.0))


@kernel
def _bumped(bumps: Bumps | None, i: int, at: At, tangents: Tangents, wo: Vec3) -> Frame:
    if bumps is None:
        return _identity()
    return bump_basis(bumps, i, at, tangents, wo)


@kernel
def _mapped(
    maps: NormalMaps | None, i: int, shading: Shading, tangents: Tangents, wo: Vec3
) -> Frame:
    if maps is None:
        return _identity()
    return map_basis(maps, i, shading.at, tangents, wo)


@kernel
def _shadows(maps: Any, i: int) -> bool:
    if maps is None:
        return False
    return bool(maps.shadows[i] != 0)


@kernel
def scatters_from(leaf: FlattenedLeaf, wi: Vec3) -> bool:
    """Whether a flattened leaf scatters light from the local `wi`: not where wi is on different
    sides of the surface and of the tilted frame (Mitsuba's rule)."""
    if leaf.side == 0.0:
        return True
    return leaf.side * wi.z * to_local(leaf.basis, wi).z > 0.0


@kernel
def shadow_of(leaf: FlattenedLeaf, wi: Vec3) -> float:
    """The factor, 1 for none, on light from the local `wi` where the leaf's frame is tilted."""
    if leaf.alpha2 == 0.0:
        return 1.0
    return shadowing(leaf.alpha2, wi)


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

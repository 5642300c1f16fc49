"""Samplers, in both directions.  Which points are taken does not change the expected picture."""

import math
from typing import Any

from comparisons.mitsuba.context import UntranslatableError
from comparisons.mitsuba.node import Node
from reference_rt.sampling import AnySampler, Grid, Independent, Sobol

STRATIFIED = ("stratified", "multijitter", "orthogonal", "ldsampler")
"""Mitsuba's samplers that are read as Sobol' points."""


def translate_sampler(
    sampler: Any, in_file: bool = False, has_media: bool = False
) -> dict[str, Any]:
    """A sampler's dict;  in_file: with its seed, and of the kind that ours is;  has_media: whether
    the scene has media.  Raises UntranslatableError."""
    match sampler:
        case Grid(spp=spp):
            return {"type": "stratified", "sample_count": spp, "jitter": False}
        case Sobol(spp=spp, seed=seed) | Independent(spp=spp, seed=seed):
            found: dict[str, Any] = {"type": "independent", "sample_count": spp}
            if in_file:
                found["seed"] = seed
                # Not `ldsampler`, though it is nearer to Sobol' points: its pictures have another
                # mean.  In media no stratified sampler has the right one (`findings/`).
                if isinstance(sampler, Sobol) and not has_media:
                    found["type"] = "multijitter"
            return found
    raise UntranslatableError(sampler, "sampler")


def read_sampler(node: Node | None) -> AnySampler:
    """The Sobol' points, or independent ones, as many.  Raises SceneError."""
    if node is None:
        return Independent(spp=4)
    if node.plugin not in ("independent", *STRATIFIED):
        raise node.unsupported(f"expected one of: {', '.join(('independent', *STRATIFIED))}")
    jitters = node.flag("jitter", True)
    node.ignore("strength")
    with node.checking():
        kind = Independent if node.plugin == "independent" else Sobol
        spp, seed = node.integer("sample_count", 4), node.integer("seed", 0)
        sampler: AnySampler = kind(spp=spp, seed=seed)
        if node.plugin == "stratified" and not jitters and math.isqrt(spp) ** 2 == spp > 0:
            sampler = Grid(spp=spp)
    node.finish()
    return sampler

"""Fine meshes that stand in for curved surfaces that Mitsuba lacks, with the surface's normals;
their distance from the surface is measured."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import numpy as np

from comparisons.mitsuba.stand_ins import Plugin, StandIn
from comparisons.mitsuba.translate.errors import UntranslatableError
from comparisons.mitsuba.translate.shapes.meshes import Soup, placed
from comparisons.mitsuba.translate.shapes.patches import Box, Implicit, Patch, meshed
from comparisons.mitsuba.translate.shapes.plugins import Site, with_mesh_light
from comparisons.mitsuba.translate.shapes.stand_in_errors import (
    MOST_TWIST,
    aspects,
    measured_error,
    measured_slip,
    measured_twist,
)
from reference_rt.core import transform
from reference_rt.shapes.shape import Shape

_fineness = ContextVar("fineness", default=1.0)


@contextmanager
def coarser(factor: float) -> Iterator[None]:
    """Meshes with `factor` times as many cells along each side are made inside the block: for many
    scenes of few rays each, whose meshes would take most of the time.  Their larger error is
    measured as that of any others."""
    token = _fineness.set(factor)
    try:
        yield
    finally:
        _fineness.reset(token)


def stand_in(
    shape: Shape,
    patches: Sequence[Patch],
    surface: Implicit,
    box: Box | None,
    site: Site,
    with_uv: Callable[[Soup], Soup] | None = None,
) -> Plugin:
    """The mesh that stands in for a shape, and its error in the scene; patches, surface and box are
    in the shape's own coordinates.  with_uv: adds texture coordinates, where there is a texture."""
    if _is_bumped(site.parts):
        # Bump tilts by the derivatives of the position by u and v, which Mitsuba takes as constant
        # on each triangle of a mesh: where a cone narrows by a tenth within a triangle, the slope
        # is a tenth off.
        raise UntranslatableError(f"{type(shape).__name__} under a bump map", "shape")
    own = transform.affine(shape.transform)
    key: tuple[Any, ...] = ("stand-in", id(shape))
    if key not in site.shared:
        fineness = _fineness.get()
        soup = meshed(patches, surface, box, fineness)
        sag, turn = measured_error(soup, surface, own)
        coarse, _ = measured_error(meshed(patches, surface, box, 0.5 * fineness), surface, own)
        name, ratio = type(shape).__name__.lower(), coarse / sag if sag > 0.0 else 1.0
        site.shared[key] = soup, StandIn(name, len(soup.faces), sag, turn, ratio)
    soup, found = site.shared[key]
    if with_uv is not None and site.textured:
        key = (*key, "uv")
        if key not in site.shared:
            site.shared[key] = with_uv(soup)
        soup = site.shared[key]
    if site.textured and soup.uvs is not None:
        key = (*key, "slip")
        if key not in site.shared:
            site.shared[key] = measured_slip(soup, patches[0], box)
        found = found._replace(slip=site.shared[key])
    m = transform.compose(own, site.place.outer)
    if site.oriented and soup.uvs is not None:
        twist = measured_twist(soup, patches[0], surface, box, m)
        if twist > MOST_TWIST:
            raise UntranslatableError(
                f"{type(shape).__name__} whose lines of constant z run towards the axis, under an "
                "anisotropic material",
                "shape",
            )
        found = found._replace(twist=twist)
    site = with_mesh_light(site, normals=True, stands_in=True)
    # The maps after the shape's own stretch distances, and turn angles, at most by these factors.
    stretch, of_all = (np.linalg.svd(x[:, :3], compute_uv=False) for x in (site.place.outer, m))
    found = found._replace(
        sag=float(found.sag * stretch[0]),
        turn=float(found.turn * stretch[0] / stretch[-1]),
        slip=float(found.slip * of_all[0]),
    )
    mirrored = bool(np.linalg.det(m[:, :3]) < 0.0)
    plugin = placed(soup, key, m, mirrored, site)
    return plugin._replace(
        faces=soup.all_of_face(0),
        stand_in=found,
        aspects=aspects(soup, m),
        uv_of_mesh=soup.uvs is not None,
    )


def _is_bumped(part: Any) -> bool:
    """Whether a bump map is among the parts of a shape."""
    if not isinstance(part, dict):
        return False
    return part.get("type") in ("bumpmap", "exact_bump") or any(
        _is_bumped(inner) for inner in part.values()
    )

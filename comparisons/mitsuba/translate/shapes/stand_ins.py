"""Fine meshes that stand in for curved surfaces that Mitsuba lacks, with the surface's normals;
their distance from the surface is measured."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import numpy as np

from comparisons.mitsuba.coordinates import Coordinates
from comparisons.mitsuba.stand_ins import Plugin, StandIn
from comparisons.mitsuba.translate.errors import UntranslatableError
from comparisons.mitsuba.translate.shapes.meshes import (
    MOST_INSTANCES,
    MOST_TRIANGLES,
    Soup,
    placed,
)
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
    of: Coordinates,
    with_uv: Callable[[Soup], Soup] | None = None,
) -> Plugin:
    """The mesh that stands in for a shape, and its error in the scene; patches, surface, box and
    `of` are in the shape's own coordinates.  with_uv: adds texture coordinates, where there is a
    texture."""
    own = transform.affine(shape.transform)
    most = 2.0 * sum(patch.cells[0] * patch.cells[1] for patch in patches) * _fineness.get() ** 2
    exact = _has_exact_coordinates(site, most)
    fineness = _fineness.get()
    if exact:
        # Not instances, in which the plugin does not know the place of the surface.
        fineness *= min(1.0, (MOST_TRIANGLES / (site.copies * most)) ** 0.5)
    key: tuple[Any, ...] = ("stand-in", id(shape), fineness)
    if key not in site.shared:
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
        found = found._replace(slip=site.shared[key], shift=0.0 if exact else site.shared[key])
    m = transform.compose(own, site.place.outer)
    if site.oriented and soup.uvs is not None:
        twist = measured_twist(soup, of, surface, m, exact)
        if not exact and (_is_bumped(site.parts) or twist > MOST_TWIST):
            raise UntranslatableError(
                f"{type(shape).__name__} under a bump map, or an anisotropic material where lines "
                f"of constant z run towards the axis, in a group with {site.copies} copies,",
                "shape",
            )
        found = found._replace(twist=twist)
    site = with_mesh_light(site, normals=True, stands_in=True)
    if exact:
        parts = {**site.parts, "bsdf": _with_coordinates(site.parts["bsdf"], of, m)}
        site = site._replace(parts=parts, copies=1)
    # The maps after the shape's own stretch distances, and turn angles, at most by these factors.
    stretch, of_all = (np.linalg.svd(x[:, :3], compute_uv=False) for x in (site.place.outer, m))
    found = found._replace(
        sag=float(found.sag * stretch[0]),
        turn=float(found.turn * stretch[0] / stretch[-1]),
        slip=float(found.slip * of_all[0]),
        shift=float(found.shift * of_all[0]),
    )
    mirrored = bool(np.linalg.det(m[:, :3]) < 0.0)
    plugin = placed(soup, key, m, mirrored, site)
    return plugin._replace(
        faces=soup.all_of_face(0),
        stand_in=found,
        aspects=aspects(soup, m),
        uv_of_mesh=soup.uvs is not None,
    )


def _has_exact_coordinates(site: Site, triangles: float) -> bool:
    """Whether a mesh of so many triangles has the surface's own uv and tangents: if its material
    depends on them, unless there are so many copies that they are instances, or Mitsuba's own
    materials are asked for."""
    if not site.textured or site.native:
        return False
    few = site.copies <= MOST_INSTANCES or site.copies * triangles <= MOST_TRIANGLES
    return few or "emitter" in site.parts


def _with_coordinates(bsdf: dict[str, Any], of: Coordinates, m: transform.Affine) -> dict[str, Any]:
    """A BSDF inside the plugin `comparisons.mitsuba.plugins.exact_coordinates`, on a surface under
    the map m."""
    linear, inverse = m[:, :3], np.linalg.inv(m[:, :3])
    found = {"type": "exact_coordinates", "nested": bsdf, **of.numbers()}
    for letter, matrix in (("m", linear), ("i", inverse)):
        found |= {f"{letter}_{j}{k}": float(matrix[j, k]) for j in range(3) for k in range(3)}
    place = transform.apply_points(m, np.array([of.origin]))[0]
    return {**found, **{f"o_{k}": float(place[k]) for k in range(3)}}


def _is_bumped(part: Any) -> bool:
    """Whether a bump map is among the parts of a shape."""
    if not isinstance(part, dict):
        return False
    return part.get("type") in ("bumpmap", "exact_bump") or any(
        _is_bumped(inner) for inner in part.values()
    )

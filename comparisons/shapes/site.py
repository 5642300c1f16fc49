"""Where a shape stands and what it is made of, for Mitsuba: `Site`; meshes and instances there."""

from typing import Any, NamedTuple

import numpy as np

from comparisons.geometry import affine
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.context import UntranslatableError
from comparisons.mitsuba.hits import Plugin, ShapeGroup
from comparisons.shapes.soup import Soup
from reference_rt.core.arrays import FloatArray
from reference_rt.shapes.shape import TabulationContext


class Site(NamedTuple):
    """The placement and the material of a leaf.

    place: the maps of its solid and its instance, applied after its own transform;  parts: the
    BSDF, the emitter, if it is emissive, and the media that it bounds;  coloured: the same for a
    mesh with vertex colours;  textured: whether the material depends on uv or tangents;  oriented:
    on tangents;  material: its name;  copies: the number of copies of the leaf;  shared: data
    shared by the leaves of one scene, by key (a group, the triangles of a file);  reach: about the
    largest coordinate of the scene;  native: whether Mitsuba's own materials are used;  media: the
    names of the media inside and outside.
    """

    place: TabulationContext
    parts: dict[str, Any]
    coloured: dict[str, Any]
    textured: bool
    oriented: bool
    material: str | None
    copies: int
    shared: dict[Any, Any]
    reach: float
    native: bool = False
    media: tuple[str | None, str | None] = (None, None)

    @property
    def mirrored(self) -> bool:
        """Whether its solids and its instance mirror space: triangles then keep their front, but
        reverse their corners."""
        return bool(np.linalg.det(self.place.outer[:, :3]) < 0.0)


def to_world(linear: FloatArray, offset: FloatArray) -> Any:
    """p -> linear p + offset, in float64; Mitsuba rounds it when it makes the shape."""
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([linear, offset])
    return mitsuba().ScalarTransform4d(matrix)


def with_mesh_light(site: Site, normals: bool = False, stands_in: bool = False) -> Site:
    """The site with our plugin `comparisons.mitsuba.plugins.mesh_area` for a mesh that emits, where
    Mitsuba's own emitter is not exact: with a texture, or with vertex normals.  stands_in: whether
    these are a curved surface's."""
    if "emitter" not in site.parts:
        return site
    more = {"type": "mesh_area", "by_normals": stands_in}

    def exact(parts: dict[str, Any]) -> dict[str, Any]:
        emitter = parts["emitter"]
        plain = emitter["radiance"]["type"] == "rgb" and not normals
        return parts if plain else {**parts, "emitter": {**emitter, **more}}

    return site._replace(parts=exact(site.parts), coloured=exact(site.coloured))


def instance_of(name: str, member: Any, m: affine.Affine, site: Site) -> Plugin:
    """A Mitsuba shape (see `ShapeGroup.member`) under any affine map: an instance of a group of its
    own, one for each `name`, material and pair of media."""
    if "emitter" in site.parts:
        raise UntranslatableError("emissive material of an instance", "material")
    key = (name, site.material, site.media)
    if key not in site.shared:
        if isinstance(member, dict):
            member = {**member, **site.parts}
        site.shared[key] = ShapeGroup(f"group_{len(site.shared)}", member)
    group: ShapeGroup = site.shared[key]
    reference = {"type": "ref", "id": group.name}
    value = {"type": "instance", "to_world": to_world(m[:, :3], m[:, 3]), "group": reference}
    return Plugin(value, group=group)


MOST_TRIANGLES = 4_000_000
"""Most triangles of all copies of a mesh together, 0.3 kB each.  With more Mitsuba gets instances,
which it traces less exactly: in groups it ignores the flag for watertight intersections (of 100,000
rays at edges 7,226 passed between triangles; without a group, 15)."""

MOST_INSTANCES = 32
"""Most instances in a scene of Mitsuba's fast variants: see `counterpart.InstancedGroup`."""


def placed(soup: Soup, key: Any, m: affine.Affine, mirrored: bool, site: Site) -> Plugin:
    """Triangles under the map m: a mesh, or, with many copies that do not emit, an instance of the
    one mesh for `key`.  `mirrored`: see `Soup.moved`.  Raises UntranslatableError."""
    parts = site.parts if soup.colours is None else site.coloured
    few = site.copies * len(soup.faces) <= MOST_TRIANGLES
    if site.copies == 1 or few or "emitter" in site.parts:
        return Plugin(soup.moved(m, mirrored).mesh(parts))
    if soup.attributes():
        # Mitsuba 3.9.1 interpolates attributes of instances at the place in the world, not in the
        # group.
        raise UntranslatableError(
            f"mesh with vertex colours or further uv in a group with {site.copies} copies,", "shape"
        )
    # Mitsuba transforms normals of instances as we do: the front stays the front.
    return instance_of(str(key), lambda: soup.mesh(parts), m, site)


def curved_instance(name: str, m: affine.Affine, site: Site) -> Plugin:
    """Mitsuba's unit shape of type `name`, with a quadratic equation, under any affine map.

    The group contains a scaled shape: ray directions in it must not be longer than 1, or hits in
    llvm variants are inexact (for a sphere a tenth as large as the group's: 1e-2 at distance 10),
    nor all shorter (half as long, five times the error).
    """
    least = scale = np.linalg.svd(m[:, :3], compute_uv=False)[-1]
    member = {"type": name, "to_world": to_world(scale * np.eye(3), np.zeros(3))}
    map_ = np.column_stack([m[:, :3] / scale, m[:, 3]])
    return instance_of(f"{name} {scale}", member, map_, site)._replace(curved=in_float32(least))


THIN = 64.0
"""Cylinders and ellipsoids this many times smaller than the scene are meshes.  Llvm variants solve
their quadratics in float32, with an error of some u D² / r (see `hits.CURVED`): with D / r = 1000
every other ray misses a cylinder; with 500 light at the rim of a flat ellipsoid is 8 % off.  All
variants project the hit onto the unit sphere, which turns its error across a flat ellipsoid into
one along it: a fifth of the radius, where it is 5,000 times as wide as high."""


def is_thin(least: float, site: Site) -> bool:
    """Whether a shape with the least radius `least` is one of those."""
    return least * THIN < site.reach


def in_float32(radius: float) -> float:
    """`Plugin.curved` of a surface with this radius; 0 in scalar variants, which solve its equation
    in float64."""
    return 0.0 if mitsuba().variant().startswith("scalar") else float(radius)

"""Cylinders, with or without caps.  Mitsuba's are exact where they stay round."""

from typing import Any

import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.frame import ROUNDINGS
from comparisons.mitsuba.files import Vector
from comparisons.mitsuba.hits import Plugin, same_uv
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.parse import as_transform
from comparisons.mitsuba.plugins.exact_coordinates import of_cone
from comparisons.shapes.reading_maps import (
    TOLERANCE,
    composed,
    scaled,
    transform_of,
    turned_inside_out,
)
from comparisons.shapes.shape import OwnPlugin, PbrtPart, PbrtPlace, ShapeType, is_capped
from comparisons.shapes.site import Site, curved_instance, in_float32, is_thin, to_world
from comparisons.shapes.stand_ins import stand_in
from comparisons.shapes.tubes import (
    Tube,
    cap_plugins,
    followed,
    tube_for_cycles,
    tube_for_povray,
    tube_for_raysect,
    tube_surface,
    tube_triangles,
    unwrapped,
)
from reference_rt.core.arrays import FloatArray
from reference_rt.shapes import Cylinder, Shape

MESH_IS_NEARER = 1.0 / (3.0 * ROUNDINGS)
"""The radius below which, in Mitsuba's scalar variants, hit points on a mesh are nearer to the
cylinder than on its own plugin: at the distance D they are up to 3 ROUNDINGS u D off a mesh
(`frame.delta`), and some u D / radius off the plugin (`findings/mitsuba-thin-cylinders.sh`)."""


def _tube(shape: Cylinder) -> Tube:
    return Tube(shape.radius, shape.radius, shape.z_min, shape.z_max, shape.capped)


def _to_mitsuba(shape: Cylinder, site: Site) -> list[Plugin]:
    m = affine.map_in(shape, site.place)
    r, height = shape.radius, shape.z_max - shape.z_min
    unit = followed(m, np.array([r, r, height]), shape.z_min)
    least = np.linalg.svd(m[:, :2], compute_uv=False)[-1] * r
    is_circular = is_round(unit[:, :3])
    solved_in_float32 = in_float32(least) > 0.0
    by_mesh = is_thin(least, site) and (solved_in_float32 or least < MESH_IS_NEARER)
    if by_mesh or ("emitter" in site.parts and not is_circular):  # Mitsuba's instances do not emit
        surface = tube_surface(_tube(shape), site.textured)
        side = stand_in(shape, surface, site, of_cone(r, 0.0, shape.z_min, height))
    elif is_circular:
        place = to_world(unit[:, :3], unit[:, 3])
        plugin = {"type": "cylinder", "to_world": place, **site.parts}
        side = Plugin(plugin, uv=same_uv, curved=in_float32(least))
    else:
        side = curved_instance("cylinder", unit, site)._replace(uv=same_uv)
    return [side, *cap_plugins(_tube(shape), m, site)]


def is_round(linear: FloatArray) -> bool:
    """Whether a map (3, 3) takes circular cylinders along z to circular ones, of any height."""
    x, y, z = linear.T
    z = z * np.linalg.norm(x) / np.linalg.norm(z)
    return affine.is_similarity(np.column_stack([x, y, z]))


def _own_plugin(shape: Cylinder, linear: FloatArray, textured: bool) -> OwnPlugin | None:
    if shape.capped or not is_round(linear):
        return None
    ends = {"p0": Vector(0.0, 0.0, shape.z_min), "p1": Vector(0.0, 0.0, shape.z_max)}
    return "cylinder", {**ends, "radius": float(shape.radius)}


def _to_pbrt(shape: Cylinder, at: PbrtPlace) -> list[PbrtPart]:
    if at.textured and shape.capped:
        return []
    m, low, high = at.place, shape.z_min * at.size, shape.z_max * at.size
    if at.mirrored and not at.textured:
        m, low, high = m * [1.0, 1.0, -1.0, 1.0], -high, -low
    radius = {"float radius": shape.radius * at.size}
    params = {**radius, "float zmin": low, "float zmax": high}
    parts = [PbrtPart(m, "cylinder", params, at.mirrored and at.textured)]
    if shape.capped:
        for place, z in ((m, high), (m * [1.0, -1.0, -1.0, 1.0], -low)):
            parts.append(PbrtPart(place, "disk", {**radius, "float height": z}))
    return parts


def _read(reading: Reading, node: Node, material: str | None) -> Shape:
    radius = node.number("radius", 1.0)
    p0 = np.array(node.vector("p0", (0.0, 0.0, 0.0)))
    p1 = np.array(node.vector("p1", (0.0, 0.0, 1.0)))
    length = float(np.linalg.norm(p1 - p0))
    if not (radius > 0.0 and length > 0.0):
        raise node.error("'radius' or the distance from 'p0' to 'p1' is 0; expected more")
    turn = _frame((p1 - p0) / length)
    placed_by = node.transform()
    m = composed(placed_by, scaled(p0, turn @ np.diag([radius, radius, length])))
    linear = m[:, :3]
    gram = linear.T @ linear
    wanted = np.diag([gram[0, 0], gram[0, 0], gram[2, 2]])
    sizes = np.sqrt(np.diag(gram))
    if (np.abs(gram - wanted) > TOLERANCE * np.outer(sizes, sizes)).any():
        raise node.error(
            "'to_world' makes it oblique or elliptic, which Mitsuba renders as a round cylinder "
            "with a warning; expected one that scales its radius uniformly"
        )
    if not node.flag("flip_normals") and p0[2] < p1[2] and not (p0[:2].any() or p1[:2].any()):
        steps: Any = as_transform(node.written(), placed_by)
        return Cylinder(
            radius=radius,
            z_min=float(p0[2]),
            z_max=float(p1[2]),
            capped=False,
            transform=steps,
            material=material,
        )
    if node.flag("flip_normals"):
        form = (-1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
        return turned_inside_out(
            reading, node, material, form, (-1.5, -1.5, 0.0), (1.5, 1.5, 1.0), m
        )
    return Cylinder(capped=False, transform=transform_of(m), material=material)


def _frame(n: FloatArray) -> FloatArray:
    """(3, 3), whose columns are Mitsuba's tangents of the unit vector n, and n (Duff et al. 2017,
    "Building an Orthonormal Basis, Revisited")."""
    x, y, z = n
    sign = float(np.copysign(1.0, z))
    a = -1.0 / (sign + z)
    b = x * y * a
    s = (1.0 + sign * x * x * a, sign * b, -sign * x)
    t = (b, sign + y * y * a, -y)
    return np.column_stack([s, t, n])


CYLINDER = ShapeType(
    of=Cylinder,
    table=None,
    surface=lambda shape: tube_surface(_tube(shape)),
    to_mitsuba=_to_mitsuba,
    triangles=lambda shape, m: tube_triangles(_tube(shape), m),
    encloses=is_capped,
    from_mitsuba={"cylinder": _read},
    own_plugin=_own_plugin,
    unwrapped=unwrapped,
    to_cycles=lambda shape, folder: tube_for_cycles(_tube(shape)),
    to_raysect=lambda shape: tube_for_raysect(_tube(shape)),
    to_pbrt=_to_pbrt,
    to_povray=lambda shape, folder: tube_for_povray(_tube(shape)),
)

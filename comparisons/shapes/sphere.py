"""Spheres.  Mitsuba's are exact under similarities; ellipsoids are instances, or meshes if thin."""

from pathlib import Path
from typing import Any

import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.affine import Affine
from comparisons.geometry.exact.crossings import Crossings, Row, column, ordered, where
from comparisons.geometry.exact.dyadic import Dyadic, dot, roots
from comparisons.mitsuba.files import Vector
from comparisons.mitsuba.hits import Plugin, same_uv
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.parse import as_transform
from comparisons.mitsuba.plugins.exact_coordinates import Round
from comparisons.shapes.fine import FINE, fine, on_circle, widened
from comparisons.shapes.reading_maps import (
    TOLERANCE,
    composed,
    scaled,
    transform_of,
    turned_inside_out,
)
from comparisons.shapes.shape import (
    OwnPlugin,
    PbrtPart,
    PbrtPlace,
    PovShape,
    RaysectPart,
    ShapeType,
    TableType,
    always,
    per_face,
)
from comparisons.shapes.site import Site, curved_instance, is_thin, to_world
from comparisons.shapes.soup import Soup
from comparisons.shapes.stand_ins import stand_in, tessellated
from comparisons.shapes.surface import Patch, Surface
from reference_rt.core.arrays import FloatArray
from reference_rt.shapes import Shape, Sphere

ELLIPSOID_CELLS = (384, 192)
"""Around a thin ellipsoid's axis and along it."""


def surface_of(shape: Sphere) -> Surface:
    center, radius = np.array(shape.center), shape.radius

    def point(u: FloatArray, v: FloatArray) -> FloatArray:
        phi, theta = 2.0 * np.pi * u, np.pi * v
        s = np.sin(theta)
        unit = np.stack([s * np.cos(phi), s * np.sin(phi), np.cos(theta)], axis=-1)
        return np.asarray(center + radius * unit)

    return Surface(
        value=lambda p: np.asarray(0.5 * (np.sum((p - center) ** 2, axis=-1) - radius**2)),
        gradient=lambda p: np.asarray(p - center),
        middle=shape.center,
        half=(radius, radius, radius),
        is_full=True,
        patches=lambda: [Patch(point, ELLIPSOID_CELLS, has_uv=True)],
    )


def _crossings(row: Row, o: Dyadic, d: Dyadic) -> Crossings:
    f, r = o - column(row, "center"), column(row, "radius")
    sign, near, far = roots(dot(d, d), dot(f, d), dot(f, f) - r * r)
    t = [where(sign >= 0, near), where(sign >= 0, far)]
    return ordered(t, [np.array(True), np.array(False)], [0, 0], sign == 0)


def _to_mitsuba(shape: Sphere, site: Site) -> list[Plugin]:
    m = affine.map_in(shape, site.place)
    if not affine.is_similarity(m[:, :3]):
        m = m @ np.vstack([np.column_stack([shape.radius * np.eye(3), shape.center]), [0, 0, 0, 1]])
        least = float(np.linalg.svd(m[:, :3], compute_uv=False)[-1])
        # Mitsuba's instances do not emit.
        if is_thin(least, site) or "emitter" in site.parts:
            of = Round(shape.center, 0.0, is_sphere=True)
            return [stand_in(shape, surface_of(shape), site, of)]
        return [curved_instance("sphere", m, site)._replace(uv=same_uv)]
    center = affine.apply_points(m, np.array([shape.center]))[0]
    rotation = m[:, :3]
    plugin = {
        "type": "sphere",
        "to_world": to_world(rotation * shape.radius, center),
        # A mirrored sphere keeps its mirrored uv; flipping makes its normals point outwards.
        "flip_normals": bool(np.linalg.det(rotation) < 0.0),
        **site.parts,
    }
    return [Plugin(plugin, uv=same_uv)]


def _unwrapped(uv: FloatArray) -> FloatArray:
    """A point of the unit sphere."""
    u, v = uv.T
    return np.column_stack([on_circle(u, np.sin(np.pi * v)), np.cos(np.pi * v)])


def _to_cycles(shape: Sphere, folder: Path) -> Soup:
    grown = shape.model_copy(update={"radius": shape.radius * widened(FINE) ** 2})
    return fine(surface_of(grown), (FINE, FINE // 2))


def _to_pbrt(shape: Sphere, at: PbrtPlace) -> list[PbrtPart]:
    m = affine.compose(np.column_stack([np.eye(3), np.multiply(shape.center, at.size)]), at.place)
    # Its texture coordinate v runs down, pbrt's up.
    turned = at.mirrored or at.textured
    place = m * [1.0, 1.0, -1.0, 1.0] if turned else m
    radius = {"float radius": shape.radius * at.size}
    return [PbrtPart(place, "sphere", radius, turned and not at.mirrored)]


def _to_raysect(shape: Sphere) -> list[RaysectPart]:
    return [RaysectPart("sphere", (shape.radius,), np.column_stack([np.eye(3), shape.center]))]


def _to_povray(shape: Sphere, folder: Path) -> PovShape:
    place = np.column_stack([shape.radius * np.eye(3), shape.center])
    return PovShape("sphere { <0,0,0>, 1", place)


def _own_plugin(shape: Sphere, linear: FloatArray, textured: bool) -> OwnPlugin | None:
    if not affine.is_similarity(linear) or np.linalg.det(linear) <= 0.0:
        return None
    return "sphere", {"center": Vector(*shape.center), "radius": float(shape.radius)}


def _read(reading: Reading, node: Node, material: str | None) -> Shape:
    center, radius = node.vector("center", (0.0, 0.0, 0.0)), node.number("radius", 1.0)
    if not radius > 0.0:
        raise node.error(f"'radius' is {radius:g}; expected more than 0")
    placed_by, flips = node.transform(), node.flag("flip_normals")
    if (
        not flips
        and affine.is_similarity(placed_by[:, :3])
        and np.linalg.det(placed_by[:, :3]) > 0.0
    ):
        steps: Any = as_transform(node.written(), placed_by)
        return Sphere(center=center, radius=radius, transform=steps, material=material)
    m = composed(placed_by, scaled(np.array(center), radius * np.eye(3)))
    linear = m[:, :3]
    lengths = np.linalg.norm(linear, axis=0)
    gram = linear.T @ linear
    if np.abs(gram - lengths[0] ** 2 * np.eye(3)).max() > TOLERANCE * lengths.max() ** 2:
        raise node.error(
            "'to_world' makes it an ellipsoid, which Mitsuba renders as a sphere with a warning; "
            "expected a uniform scale, or an instance of a group with the sphere"
        )
    # A map that mirrors turns Mitsuba's spheres inside out, but not its cylinders (measured).
    if flips != bool(np.linalg.det(linear) < 0.0):
        form = (-1.0, -1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
        return turned_inside_out(
            reading, node, material, form, (-1.5, -1.5, -1.5), (1.5, 1.5, 1.5), m
        )
    return Sphere(transform=transform_of(_orthogonal(m, lengths[0])), material=material)


def _orthogonal(m: Affine, size: float) -> Affine:
    """The nearest similarity: what XML has rounded is no exact rotation."""
    u, _, v = np.linalg.svd(m[:, :3] / size)
    return np.column_stack([size * (u @ v), m[:, 3]])


SPHERE = ShapeType(
    of=Sphere,
    table=TableType(
        field="spheres",
        crossings=_crossings,
        features=lambda table: per_face(np.asarray(table.radius)),
    ),
    surface=surface_of,
    to_mitsuba=_to_mitsuba,
    triangles=lambda shape, m: tessellated(surface_of(shape), m),
    encloses=always,
    from_mitsuba={"sphere": _read},
    own_plugin=_own_plugin,
    unwrapped=_unwrapped,
    to_cycles=_to_cycles,
    to_pbrt=_to_pbrt,
    to_raysect=_to_raysect,
    is_sampled=True,
    to_povray=_to_povray,
)

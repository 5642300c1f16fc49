"""Disks, which in Mitsuba are right under every affine map."""

from typing import Any

import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.exact.crossings import Crossings, Row, plane_crossing, single
from comparisons.geometry.exact.dyadic import Dyadic
from comparisons.mitsuba.hits import Plugin, same_uv
from comparisons.mitsuba.node import Node, Reading
from comparisons.shapes.fine import fan, on_circle
from comparisons.shapes.flat import as_written, flat, flat_transform, on_plane, unit_lengths
from comparisons.shapes.shape import (
    PbrtPart,
    PbrtPlace,
    ShapeType,
    TableType,
    Tessellation,
    never,
    per_face,
)
from comparisons.shapes.site import Site, to_world
from comparisons.shapes.soup import Soup
from comparisons.shapes.surface import Surface
from reference_rt.core.arrays import FloatArray
from reference_rt.shapes import Disk, Shape

SIDES = 1024
"""Triangles of a disk."""


def surface_of(shape: Disk) -> Surface:
    return flat(1.0, lambda q: np.asarray(np.hypot(q[:, 0], q[:, 1]) - 1.0))


def _crossings(row: Row, o: Dyadic, d: Dyadic) -> Crossings:
    m = plane_crossing(row, o, d)
    sign = (m.den * m.den - m.x * m.x - m.y * m.y).sign()
    return single(m, sign >= 0, sign == 0)


def _to_mitsuba(shape: Disk, site: Site) -> list[Plugin]:
    m = affine.map_in(shape, site.place)
    return [
        Plugin({"type": "disk", "to_world": to_world(m[:, :3], m[:, 3]), **site.parts}, uv=same_uv)
    ]


def _targets(table: Any) -> FloatArray:
    phi = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    return on_plane(table, np.column_stack([np.cos(phi), np.sin(phi)]))


def _triangles(shape: Disk, m: affine.Affine) -> Tessellation:
    return [_soup()], (1.0 - np.cos(np.pi / SIDES)) * float(np.abs(m[:, :2]).max())


def _soup() -> Soup:
    """The unit disk, with uv of its own in each triangle: the distance from the middle, and the
    angle from 0 to 1."""
    turn = np.arange(SIDES + 1) / SIDES
    rim = np.column_stack([np.cos(2.0 * np.pi * turn), np.sin(2.0 * np.pi * turn), 0.0 * turn])
    k = np.arange(SIDES)
    corners = np.stack([np.zeros((SIDES, 3)), rim[k], rim[k + 1]], axis=1)
    uv = np.stack(
        [
            np.column_stack([np.zeros(SIDES), 0.5 * (turn[k] + turn[k + 1])]),
            np.column_stack([np.ones(SIDES), turn[k]]),
            np.column_stack([np.ones(SIDES), turn[k + 1]]),
        ],
        axis=1,
    )
    return Soup(corners.reshape(-1, 3), uvs=uv.reshape(-1, 2))


def _unwrapped(uv: FloatArray) -> FloatArray:
    """x and y."""
    radius, turns = uv.T
    return np.column_stack([on_circle(turns, radius), np.zeros_like(radius)])


def _to_pbrt(shape: Disk, at: PbrtPlace) -> list[PbrtPart]:
    if at.textured:
        return []
    place = at.place * [-1.0, 1.0, 1.0, 1.0] if at.mirrored else at.place
    return [PbrtPart(place, "disk", {"float radius": at.size})]


def _read(reading: Reading, node: Node, material: str | None) -> Shape:
    return Disk(transform=flat_transform(node), material=material)


DISK = ShapeType(
    of=Disk,
    table=TableType(
        field="disks",
        crossings=_crossings,
        features=lambda table: per_face(np.array([min(unit_lengths(table))])),
        targets=_targets,
    ),
    surface=surface_of,
    to_mitsuba=_to_mitsuba,
    triangles=_triangles,
    encloses=never,
    from_mitsuba={"disk": _read},
    own_plugin=as_written("disk"),
    unwrapped=_unwrapped,
    to_cycles=lambda shape, folder: fan(1.0, 0.0, 1.0),
    to_pbrt=_to_pbrt,
    is_sampled=True,
    to_povray=lambda shape, folder: "disc { <0,0,0>, z, 1",
)

"""Shapes that Mitsuba has too, made from the float64 numbers of the descriptions.

Under a mirroring transform Mitsuba's rectangles, cubes and spheres turn inside out, or are
inconsistent (a rectangle's geometric normal follows the winding, its shading normal the transform);
ours keep their outward side.  So these get no mirroring transform.  Mitsuba's disks are right under
every affine map, its spheres only under similarities.
"""

import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.affine import Affine, apply_points, is_similarity
from comparisons.geometry.frame import UNIT_ROUNDOFF
from comparisons.mitsuba.hits import CURVED, Plugin, same_uv
from comparisons.mitsuba.plugins.exact_coordinates import Round
from comparisons.mitsuba.translate.shapes.meshes import Soup
from comparisons.mitsuba.translate.shapes.site import (
    Site,
    curved_instance,
    in_float32,
    to_world,
    translate_shape,
    with_mesh_light,
)
from comparisons.mitsuba.translate.shapes.stand_ins import stand_in
from comparisons.mitsuba.translate.shapes.surfaces import Implicit, Patch
from reference_rt.core.arrays import FloatArray
from reference_rt.shapes import Box, Disk, Rectangle, Sphere

CELLS = (384, 192)
"""Around a thin ellipsoid's axis and along it."""

CUBE_FACES = (1, 4, 3, 5, 0, 2)
"""Our face numbers of the faces of Mitsuba's cube, which are -y +y +x +z -x -z, two triangles each
(src/shapes/cube.cpp)."""


@translate_shape.register
def _(shape: Sphere, site: Site) -> list[Plugin]:
    m = affine.map_in(shape, site.place)
    if not is_similarity(m[:, :3]):
        m = m @ np.vstack([np.column_stack([shape.radius * np.eye(3), shape.center]), [0, 0, 0, 1]])
        least = float(np.linalg.svd(m[:, :3], compute_uv=False)[-1])
        thin = in_float32(least) > 0.0 and CURVED * UNIT_ROUNDOFF * site.reach**2 > least**2
        # The error of Mitsuba's own sphere would exceed its thickness, and its instances do not
        # emit.
        if thin or "emitter" in site.parts:
            return [_ellipsoid(shape, site)]
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


def _ellipsoid(shape: Sphere, site: Site) -> Plugin:
    """A thin ellipsoid as a mesh: float32 is more exact for its corners than for its quadratic."""
    patches, surface = sphere_surface(shape)
    of = Round(shape.center, 0.0, is_sphere=True)
    return stand_in(shape, patches, surface, None, site, of)


def sphere_surface(shape: Sphere) -> tuple[list[Patch], Implicit]:
    """The surface in its own coordinates."""
    center, radius = np.array(shape.center), shape.radius

    def point(u: FloatArray, v: FloatArray) -> FloatArray:
        phi, theta = 2.0 * np.pi * u, np.pi * v
        s = np.sin(theta)
        unit = np.stack([s * np.cos(phi), s * np.sin(phi), np.cos(theta)], axis=-1)
        return np.asarray(center + radius * unit)

    surface = Implicit(
        value=lambda p: np.asarray(np.linalg.norm(p - center, axis=-1) - radius),
        gradient=lambda p: np.asarray(p - center),
    )
    return [Patch(point, CELLS, has_uv=True)], surface


@translate_shape.register
def _(shape: Rectangle, site: Site) -> list[Plugin]:
    m = affine.map_in(shape, site.place)
    mirrored = bool(np.linalg.det(m[:, :3]) < 0.0)
    # The third column has no effect but on orientation.
    columns = np.column_stack([m[:, 0], m[:, 1], -m[:, 2] if mirrored else m[:, 2]])
    plugin = {
        "type": "rectangle",
        "to_world": to_world(columns, m[:, 3]),
        "flip_normals": mirrored,
        **site.parts,
    }
    return [Plugin(plugin, faces=np.zeros(2, np.int64), uv=same_uv)]  # two triangles


@translate_shape.register
def _(shape: Disk, site: Site) -> list[Plugin]:
    m = affine.map_in(shape, site.place)
    return [
        Plugin({"type": "disk", "to_world": to_world(m[:, :3], m[:, 3]), **site.parts}, uv=same_uv)
    ]


@translate_shape.register
def _(shape: Box, site: Site) -> list[Plugin]:
    m = affine.map_in(shape, site.place)
    if site.textured:
        return [_box_of_triangles(m, site)]
    edges = m[:, :3].copy()
    faces = np.array(CUBE_FACES)
    if np.linalg.det(edges) < 0.0:
        # Mirror it along an axis: the same box.  As a Whitted light its point is in the middle of
        # this axis, and does not move (see comparisons.mitsuba.plugins.whitted).
        turned = _middle_axis(edges)
        edges[:, turned] *= -1.0
        faces = np.where(faces % 3 == turned, (faces + 3) % 6, faces)
    plugin = {"type": "cube", "to_world": to_world(edges, m[:, 3]), **site.parts}
    return [Plugin(plugin, faces=np.repeat(faces, 2))]


def _box_of_triangles(m: Affine, site: Site) -> Plugin:
    """A box with our uv."""
    soup = box_of_triangles(m)
    mesh = soup.mesh(with_mesh_light(site).parts)
    return Plugin(mesh, faces=np.repeat(np.arange(6), 2), uv=same_uv)


def box_of_triangles(m: Affine) -> Soup:
    """The box under a map, with our uv: on each face the two other coordinates in the order x, y,
    z, from 0 to 1."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    positions, faces = np.empty((6, 4, 3)), []
    for face in range(6):
        axis, sign = face % 3, 1.0 if face >= 3 else -1.0
        a, b = (k for k in range(3) if k != axis)
        positions[face][:, [a, b]] = 2.0 * square - 1.0
        positions[face][:, axis] = sign
        triangles = np.array([[0, 1, 2], [0, 2, 3]]) + 4 * face
        # a, b and the outward normal are right-handed for +x, -y, +z; a mirroring map reverses all.
        outward = sign * (-1.0 if axis == 1 else 1.0) * np.linalg.det(m[:, :3])
        faces.append(triangles if outward > 0.0 else triangles[:, ::-1])
    uvs = np.tile(square, (6, 1))
    return Soup(apply_points(m, positions.reshape(-1, 3)), uvs=uvs, faces=np.concatenate(faces))


def _middle_axis(edges: FloatArray) -> int:
    areas = np.linalg.norm(np.cross(edges.T[[1, 2, 0]], edges.T[[2, 0, 1]]), axis=1)
    return 1 if areas[2] >= areas[0] + areas[1] else 2

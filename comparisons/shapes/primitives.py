"""Spheres, boxes, rectangles, disks and cylinders, which Mitsuba has too, made from the float64
numbers of the descriptions; cones, tori and other quadrics, for which meshes stand in.

Under a mirroring transform Mitsuba's rectangles, cubes and spheres turn inside out, or are
inconsistent (a rectangle's geometric normal follows the winding, its shading normal the transform);
ours keep their outward side.  So these get no mirroring transform.  Mitsuba's disks are right under
every affine map, its spheres only under similarities.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.frame import UNIT_ROUNDOFF
from comparisons.geometry.sizes import heights_of
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.hits import CURVED, Plugin, same_uv
from comparisons.mitsuba.plugins.exact_coordinates import Round, of_cone, of_quadric
from comparisons.shapes.canonical import patches_of
from comparisons.shapes.meshes import (
    Site,
    Soup,
    instance_of,
    placed,
    to_world,
    translate_shape,
    with_mesh_light,
)
from comparisons.shapes.stand_ins import stand_in
from comparisons.shapes.surfaces import (
    Implicit,
    Limits,
    Patch,
    cap_faces,
    cut_away,
    heights_over_uv,
    region,
)
from reference_rt.core.arrays import FloatArray
from reference_rt.shapes import Box, Cone, Cylinder, Disk, Quadric, Rectangle, Sphere, Torus

ELLIPSOID_CELLS = (384, 192)
"""Around a thin ellipsoid's axis and along it."""

CUBE_FACES = (1, 4, 3, 5, 0, 2)
"""Our face numbers of the faces of Mitsuba's cube, which are -y +y +x +z -x -z, two triangles each
(src/shapes/cube.cpp)."""


@translate_shape.register
def _(shape: Sphere, site: Site) -> list[Plugin]:
    m = affine.map_in(shape, site.place)
    if not affine.is_similarity(m[:, :3]):
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
    return [Patch(point, ELLIPSOID_CELLS, has_uv=True)], surface


@translate_shape.register
def _(shape: Rectangle, site: Site) -> list[Plugin]:
    m = affine.map_in(shape, site.place)
    mirrored = bool(np.linalg.det(m[:, :3]) < 0.0)
    if mirrored and "emitter" in site.parts and site.parts["emitter"]["radiance"]["type"] != "rgb":
        # Mitsuba samples the texture's light on the back of a rectangle with `flip_normals`.
        square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
        corners = np.column_stack([2.0 * square - 1.0, np.zeros(4)])
        flat = Soup(corners, uvs=square, faces=np.array([[0, 1, 2], [0, 2, 3]]))
        mesh = flat.moved(m, mirrored).mesh(with_mesh_light(site).parts)
        return [Plugin(mesh, faces=np.zeros(2, np.int64), uv=same_uv)]
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


def _box_of_triangles(m: affine.Affine, site: Site) -> Plugin:
    """A box with our uv."""
    soup = box_of_triangles(m)
    mesh = soup.mesh(with_mesh_light(site).parts)
    return Plugin(mesh, faces=np.repeat(np.arange(6), 2), uv=same_uv)


def box_of_triangles(m: affine.Affine) -> Soup:
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
    return Soup(
        affine.apply_points(m, positions.reshape(-1, 3)), uvs=uvs, faces=np.concatenate(faces)
    )


def _middle_axis(edges: FloatArray) -> int:
    areas = np.linalg.norm(np.cross(edges.T[[1, 2, 0]], edges.T[[2, 0, 1]]), axis=1)
    return 1 if areas[2] >= areas[0] + areas[1] else 2


def curved_instance(name: str, m: affine.Affine, site: Site) -> Plugin:
    """Mitsuba's unit shape of type `name`, with a quadratic equation, under any affine map.

    The group contains a scaled shape: ray directions in it must not be longer than 1, or hits in
    llvm variants are inexact (for a sphere a tenth as large as the group's: 1e-2 at distance 10).
    """
    least = np.linalg.svd(m[:, :3], compute_uv=False)[-1]
    scale = 2.0 ** np.floor(np.log2(least))
    member = {"type": name, "to_world": to_world(scale * np.eye(3), np.zeros(3))}
    map_ = np.column_stack([m[:, :3] / scale, m[:, 3]])
    return instance_of(f"{name} {scale}", member, map_, site)._replace(curved=in_float32(least))


def in_float32(radius: float) -> float:
    """`Plugin.curved` of a surface with this radius; 0 in scalar variants, which solve its equation
    in float64."""
    return 0.0 if mitsuba().variant().startswith("scalar") else float(radius)


# ---- tori ----------------------------------------------------------------------------------------

TORUS_CELLS = (768, 384)
"""Around the axis and around the tube."""


@translate_shape.register
def _(shape: Torus, site: Site) -> list[Plugin]:
    patches, surface = torus_surface(shape)
    of = Round((0.0, 0.0, 0.0), shape.major_radius)
    return [stand_in(shape, patches, surface, None, site, of)]


def torus_surface(shape: Torus) -> tuple[list[Patch], Implicit]:
    """The surface in its own coordinates."""
    major, minor = shape.major_radius, shape.minor_radius

    def point(u: FloatArray, v: FloatArray) -> FloatArray:
        phi, theta = 2.0 * np.pi * u, 2.0 * np.pi * v
        rho = major + minor * np.cos(theta)
        return np.stack([rho * np.cos(phi), rho * np.sin(phi), minor * np.sin(theta)], axis=-1)

    def from_tube(p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The vector from the nearest point of the circle, and its length."""
        rho = np.hypot(p[..., 0], p[..., 1])
        factor = 1.0 - major / rho
        across = np.stack([p[..., 0] * factor, p[..., 1] * factor, p[..., 2]], axis=-1)
        return across, np.linalg.norm(across, axis=-1)

    surface = Implicit(
        value=lambda p: from_tube(p)[1] - minor,
        gradient=lambda p: from_tube(p)[0] / from_tube(p)[1][..., None],
    )
    return [Patch(point, TORUS_CELLS, has_uv=True)], surface


# ---- texture coordinates of a quadric's mesh: the angle around z, and z --------------------------
# They have a seam and poles, where interpolating between a triangle's corners would go wrong: so
# the mesh is cut along the seam, and each triangle has corners of its own.


def around_z(soup: Soup, box: Limits) -> Soup:
    """The mesh with uv: in coordinates where the box is the cube [-1, 1]³, the angle from +x over
    2 pi, and z from 0 to 1."""
    assert soup.normals is not None
    data = np.hstack([soup.positions, soup.normals])
    parts, uvs = [], []
    middle, half = 0.5 * (box[0] + box[1]), 0.5 * (box[1] - box[0])
    for side in (1.0, -1.0):

        def beyond(rows: FloatArray, side: float = side) -> FloatArray:
            return np.asarray(side * (middle[1] - rows[:, 1]))

        kept, faces = cut_away(data, soup.faces, beyond)
        corners = kept[faces]  # (m, 3, 6)
        q = (corners[..., :3] - middle) / half
        # On this side of the seam y is not negative, but for rounding.
        phi = np.arctan2(np.maximum(side * q[..., 1], 0.0), q[..., 0])
        on_axis = np.hypot(q[..., 0], q[..., 1]) == 0.0
        others = np.where(on_axis, 0.0, phi).sum(axis=1) / np.maximum(1, (~on_axis).sum(axis=1))
        phi = np.where(on_axis, others[:, None], phi)
        u = phi / (2.0 * np.pi)
        uvs.append(np.stack([u if side > 0.0 else 1.0 - u, 0.5 * (q[..., 2] + 1.0)], axis=-1))
        parts.append(corners)
    found, uv = np.concatenate(parts).reshape(-1, 6), np.concatenate(uvs).reshape(-1, 2)
    return Soup(found[:, :3], found[:, 3:], uv)


# ---- cylinders, cones and quadrics ---------------------------------------------------------------

SIDE = (4096, 8)
"""Cells around a cone and along its side.  That is straight, but Mitsuba's hit on a triangle of
length L and height h is off by some u L² / h along the triangle: with one cell along the side by
1e-4 of it, seen at a grazing angle by a hundredth."""

RINGS = 32
"""Cells along the side of a textured cone."""

THIN = 64.0
"""Cylinders this many times smaller than the scene are meshes in llvm variants: Mitsuba solves its
own in float32 with an error of some u D² / r (see `hits.CURVED`), and with D / r = 1000 every other
ray misses them."""

BOTTOM, TOP = 3, 6
"""Face numbers: 0 is the curved surface, the others are 1 + the axis, + 3 on the positive side."""


@translate_shape.register
def _(shape: Cylinder, site: Site) -> list[Plugin]:
    m = affine.map_in(shape, site.place)
    r, height = shape.radius, shape.z_max - shape.z_min
    unit = _followed(m, np.array([r, r, height]), shape.z_min)
    least = np.linalg.svd(m[:, :2], compute_uv=False)[-1] * r
    is_circular = is_round(unit[:, :3])
    is_thin = least * THIN < site.reach and in_float32(least) > 0.0
    if is_thin or ("emitter" in site.parts and not is_circular):  # Mitsuba's instances do not emit
        patch, surface = side_surface(shape, site.textured)
        of = of_cone(r, 0.0, shape.z_min, height)
        side = stand_in(shape, [patch], surface, None, site, of)
    elif is_circular:
        place = to_world(unit[:, :3], unit[:, 3])
        plugin = {"type": "cylinder", "to_world": place, **site.parts}
        side = Plugin(plugin, uv=same_uv, curved=in_float32(least))
    else:
        side = curved_instance("cylinder", unit, site)._replace(uv=same_uv)
    found = [side]
    if shape.capped:
        found.append(_disk(m, r, shape.z_min, BOTTOM, r, site))
        found.append(_disk(m, r, shape.z_max, TOP, r, site))
    return found


def is_round(linear: FloatArray) -> bool:
    """Whether a map (3, 3) takes circular cylinders along z to circular ones, of any height."""
    x, y, z = linear.T
    z = z * np.linalg.norm(x) / np.linalg.norm(z)
    return affine.is_similarity(np.column_stack([x, y, z]))


def _followed(m: affine.Affine, scale: FloatArray, z: float) -> affine.Affine:
    """The map that scales, moves along z, then applies m."""
    return affine.compose(np.column_stack([np.diag(scale), (0.0, 0.0, z)]), m)


def _disk(m: affine.Affine, radius: float, z: float, face: int, reach: float, site: Site) -> Plugin:
    """A cap across the axis; its uv are x and y over a square of half side `reach`."""
    if site.textured:
        return _disk_of_triangles(m, radius, z, face, reach, site)
    place = _followed(m, np.array([radius, radius, radius]), z)
    plugin = {
        "type": "disk",
        "to_world": to_world(place[:, :3], place[:, 3]),
        "flip_normals": face == BOTTOM,
        **site.parts,
    }

    def over_square(uv: FloatArray) -> FloatArray:
        phi = 2.0 * np.pi * uv[:, 1]
        x_y = (uv[:, 0] * radius / reach)[:, None] * np.column_stack([np.cos(phi), np.sin(phi)])
        return np.asarray(0.5 * (1.0 + x_y))

    return Plugin(plugin, suffix=f"_cap{face}", faces=np.array([face]), uv=over_square)


def _disk_of_triangles(
    m: affine.Affine, radius: float, z: float, face: int, reach: float, site: Site
) -> Plugin:
    """The same with our uv, which Mitsuba's disk has not."""
    flat = disk_soup(z, radius, face, reach)
    soup = flat.moved(m, bool(np.linalg.det(m[:, :3]) < 0.0))
    return Plugin(
        soup.mesh(with_mesh_light(site).parts),
        suffix=f"_cap{face}",
        faces=soup.all_of_face(face),
        uv=same_uv,
        heights=heights_of(soup.positions[soup.faces]),
    )


@translate_shape.register
def _(shape: Cone, site: Site) -> list[Plugin]:
    bottom, top, height = shape.radius, shape.top_radius, shape.height
    patch, surface = side_surface(shape, site.textured)
    of = of_cone(bottom, (top - bottom) / height, 0.0, height)
    found = [stand_in(shape, [patch], surface, None, site, of)]
    if shape.capped:
        m, reach = affine.map_in(shape, site.place), max(bottom, top)
        found.append(_disk(m, bottom, 0.0, BOTTOM, reach, site))
        if top > 0.0:
            found.append(_disk(m, top, height, TOP, reach, site))
    return found


def side_surface(shape: Cone | Cylinder, textured: bool = False) -> tuple[Patch, Implicit]:
    """The side in its own coordinates.  textured: in rings, where it narrows little, so that uv are
    almost linear."""
    cells = (SIDE[0], RINGS) if textured else SIDE
    if isinstance(shape, Cylinder):
        r, low, height = shape.radius, shape.z_min, shape.z_max - shape.z_min
        return Patch(_side(r, r, low, height), cells, has_uv=True), _round(r, 0.0)
    bottom, top, height = shape.radius, shape.top_radius, shape.height
    patch = Patch(_side(bottom, top, 0.0, height), cells, has_uv=True)
    return patch, _round(bottom, (top - bottom) / height)


def _side(
    bottom: float, top: float, z: float, height: float
) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """The side of a cone or a cylinder that starts at z: (u, v) -> points."""

    def point(u: FloatArray, v: FloatArray) -> FloatArray:
        phi, r = 2.0 * np.pi * u, bottom + (top - bottom) * v
        return np.stack([r * np.cos(phi), r * np.sin(phi), z + height * v], axis=-1)

    return point


def _round(radius: float, slope: float) -> Implicit:
    """The surface whose distance from the z axis is radius + slope z."""

    def value(p: FloatArray) -> FloatArray:
        return np.asarray(np.hypot(p[..., 0], p[..., 1]) - (radius + slope * p[..., 2]))

    def gradient(p: FloatArray) -> FloatArray:
        rho = np.hypot(p[..., 0], p[..., 1])[..., None]
        out = np.divide(p[..., :2], rho, out=np.zeros_like(p[..., :2]), where=rho > 0.0)
        return np.concatenate([out, np.where(rho > 0.0, -slope, 0.0)], axis=-1)

    return Implicit(value, gradient)


@translate_shape.register
def _(shape: Quadric, site: Site) -> list[Plugin]:
    patches, surface, box = quadric_surface(shape)
    found = []
    if patches:
        of = of_quadric(*_matrix(shape), *box)
        found.append(stand_in(shape, patches, surface, box, site, of, partial(around_z, box=box)))
    if shape.capped:
        key = ("caps", id(shape))
        if key not in site.shared:
            site.shared[key] = cap_faces(surface.value, box)
        soup, faces = site.shared[key]
        if len(faces) > 0:
            m = affine.map_in(shape, site.place)
            mirrored = bool(np.linalg.det(m[:, :3]) < 0.0)
            plugin = placed(soup, key, m, mirrored, with_mesh_light(site))
            plugin = plugin._replace(suffix="_caps", faces=faces, uv=same_uv, faceted=True)
            found.append(plugin._replace(heights=heights_over_uv(soup, m)))
    return found


def quadric_surface(shape: Quadric) -> tuple[list[Patch], Implicit, Limits]:
    """The surface in its own coordinates, and the box that it is clipped to."""
    matrix, linear = _matrix(shape)
    j = shape.coefficients[9]
    box = np.array(shape.lower), np.array(shape.upper)

    def value(p: FloatArray) -> FloatArray:
        return np.asarray(np.sum((p @ matrix + linear) * p, axis=-1) + j)

    surface = Implicit(value, lambda p: np.asarray(2.0 * p @ matrix + linear))
    return patches_of(matrix, linear, j, box), surface, box


def _matrix(shape: Quadric) -> tuple[FloatArray, FloatArray]:
    """M and l of f = x^T M x + l x + c."""
    a, b, c, d, e, f, g, h, i, _ = shape.coefficients
    matrix = np.array([[a, d / 2, f / 2], [d / 2, b, e / 2], [f / 2, e / 2, c]])
    return matrix, np.array([g, h, i])


def disk_soup(z: float, radius: float, face: int, reach: float) -> Soup:
    """A cap across the axis; its uv are x and y over a square of half side `reach`.

    Of squares: a fan of thin triangles loses half of float32's digits between its corners.
    """

    def value(uv: FloatArray) -> FloatArray:
        return np.asarray((reach * reach) * np.sum((2.0 * uv - 1.0) ** 2, axis=-1) - radius**2)

    triangles = region(value)
    uv = (triangles[:, ::-1] if face == BOTTOM else triangles).reshape(-1, 2)
    positions = np.column_stack([reach * (2.0 * uv - 1.0), np.full(len(uv), z)])
    return Soup(positions, uvs=uv)

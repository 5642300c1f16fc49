"""Quadrics in a box, with or without caps on its faces, for which meshes stand in."""

import itertools
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.exact.crossings import (
    Crossings,
    Row,
    Slabs,
    column,
    in_local,
    ordered,
    where,
)
from comparisons.geometry.exact.dyadic import NEVER, Dyadic, roots, tied
from comparisons.mitsuba.hits import Plugin, same_uv
from comparisons.mitsuba.plugins.exact_coordinates import of_quadric
from comparisons.renderers.vocabulary import pov_vector
from comparisons.shapes.canonical import patches_of
from comparisons.shapes.meshing import cap_faces, cut_away, heights_over_uv
from comparisons.shapes.shape import (
    Features,
    PovShape,
    ShapeType,
    TableType,
    Tessellation,
    is_capped,
    pov_size,
)
from comparisons.shapes.site import Site, placed, with_mesh_light
from comparisons.shapes.soup import Soup
from comparisons.shapes.stand_ins import stand_in, tessellated
from comparisons.shapes.surface import Limits, Surface
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.shapes import Quadric


def surface_of(shape: Quadric) -> Surface:
    matrix, linear = _matrix(shape)
    j, box = shape.coefficients[9], _box(shape)

    def value(p: FloatArray) -> FloatArray:
        return np.asarray(np.sum((p @ matrix + linear) * p, axis=-1) + j)

    middle, half = 0.5 * (box[0] + box[1]), 0.5 * (box[1] - box[0])
    return Surface(
        value,
        lambda p: np.asarray(2.0 * p @ matrix + linear),
        tuple(middle.tolist()),
        tuple(half.tolist()),
        patches=cache(lambda: patches_of(matrix, linear, j, box)),
        ends=box,
        capped=shape.capped,
    )


def _box(shape: Quadric) -> Limits:
    return np.array(shape.lower), np.array(shape.upper)


def _matrix(shape: Quadric) -> tuple[FloatArray, FloatArray]:
    """M and l of f = x^T M x + l x + c."""
    a, b, c, d, e, f, g, h, i, _ = shape.coefficients
    matrix = np.array([[a, d / 2, f / 2], [d / 2, b, e / 2], [f / 2, e / 2, c]])
    return matrix, np.array([g, h, i])


def _crossings(row: Row, o: Dyadic, d: Dyadic) -> Crossings:
    """Codes: 0 for f's surface, else 1 + the face of the clip box.

    An uncapped quadric is entered from the side f > 0.
    """
    q, e = in_local(row, o, d)
    k = column(row, "coefficients")
    a, b, c = _along(k, q, e)
    sign, near, far = roots(a, b, c)
    s = Slabs(q, e, column(row, "lower"), column(row, "upper"), row["clipped"])
    capped = np.broadcast_to(np.asarray(row["capped"]) != 0, len(q.n))
    between = a.sign() >= 0  # f <= 0 between the roots, else outside of them
    real, never = sign >= 0, np.full(len(q.n), NEVER, dtype=object)
    touching = s.touching | (~s.misses & (sign == 0))
    for t in (near, far):
        touching |= real & ~s.misses & (tied(t, s.t_in) | tied(t, s.t_out))
    # Where f <= 0, as two intervals; without roots the whole line or nothing.
    constant_in = ~real & (c.sign() <= 0)
    start = [
        np.where(real & between, near, np.where((real & ~between) | constant_in, -never, never)),
        np.where(real & ~between, far, never),
    ]
    end = [
        np.where(real & between, far, np.where(real & ~between, near, never)),
        np.where(real & ~between, never, never),
    ]
    times, enters, codes = [], [], []
    for low, high in zip(start, end, strict=True):
        inside_low, inside_high = np.maximum(low, s.t_in), np.minimum(high, s.t_out)
        some = ~s.misses & (inside_low < inside_high)
        for t, on_f, cap, way in (
            (inside_low, low >= s.t_in, s.code_in, True),
            (inside_high, high <= s.t_out, s.code_out, False),
        ):
            shown = some & (on_f | capped) & (abs(t) < NEVER)
            times.append(where(shown, t))
            enters.append(np.array(way))
            codes.append(np.where(on_f, 0, 1 + cap))
    return ordered(times, enters, codes, touching)


def _along(k: Dyadic, q: Dyadic, e: Dyadic) -> tuple[Dyadic, Dyadic, Dyadic]:
    """f(q + t e) = a t² + 2 b t + c; f's coefficients in the order x² y² z² xy yz xz x y z 1."""
    pairs = list(itertools.chain(((i, i) for i in range(3)), ((0, 1), (1, 2), (0, 2))))

    def quadratic(u: Dyadic, v: Dyadic) -> Dyadic:
        terms = [k[..., n] * u[..., i] * v[..., j] for n, (i, j) in enumerate(pairs)]
        return _total(terms)

    def linear(u: Dyadic) -> Dyadic:
        return _total([k[..., 6 + i] * u[..., i] for i in range(3)])

    half = Dyadic.of(0.5)
    b = half * (quadratic(q, e) + quadratic(e, q) + linear(e))
    return quadratic(e, e), b, quadratic(q, q) + linear(q) + k[..., 9]


def _total(terms: list[Dyadic]) -> Dyadic:
    total = terms[0]
    for term in terms[1:]:
        total = total + term
    return total


def _lengths(table: Any, of_normals: bool) -> Features:
    """In the group's coordinates;  of_normals: without uv.

    Where f's gradient g turns, g / |g| moves by H / |g| times a step, H the Hessian, less what is
    along g: on a flat ellipsoid that is over its width, not its height.  Where it turns next to
    nowhere, rounding still does: over the largest height of the clip box at most.  uv change over
    |g| / |H| at least, and over the smallest of these heights, in which caps have theirs.
    """
    m = table.to_local[0].reshape(3, 3)
    k = table.coefficients[0]
    own = np.array([[2 * k[0], k[3], k[5]], [k[3], 2 * k[1], k[4]], [k[5], k[4], 2 * k[2]]])
    hessian = m.T @ own @ m
    steepest = np.linalg.norm(hessian, 2)
    heights = (table.upper - table.lower)[0] / np.linalg.norm(m, axis=1)
    least, most = heights.min(), heights.max()

    def lengths(p: FloatArray, faces: IntArray) -> FloatArray:
        gradient = ((p - table.center[0]) @ m.T @ own + k[6:9]) @ m
        size = np.linalg.norm(gradient, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            if of_normals:
                n = np.nan_to_num(gradient / size[:, None])
                across = hessian - n[:, :, None] * (n @ hessian)[:, None, :]
                found = np.minimum(size / np.linalg.norm(across, axis=(1, 2)), most)
            else:
                found = np.minimum(size / steepest, least)
        return np.asarray(np.where(faces > 0, least, np.nan_to_num(found, nan=0.0)))

    return lengths


def _to_mitsuba(shape: Quadric, site: Site) -> list[Plugin]:
    surface, box, found = surface_of(shape), _box(shape), []
    if surface.patches():
        of = of_quadric(*_matrix(shape), *box)
        found.append(stand_in(shape, surface, site, of, partial(around_z, box=box)))
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


def _triangles(shape: Quadric, m: affine.Affine) -> Tessellation:
    surface, box = surface_of(shape), _box(shape)
    parts, distance = tessellated(surface, m) if surface.patches() else ([], 0.0)
    parts = [around_z(part, box) for part in parts]
    if shape.capped:
        caps, faces = cap_faces(surface.value, box)
        parts += [caps] if len(faces) else []
    return parts, distance


def _to_povray(shape: Quadric, folder: Path) -> PovShape:
    """POV-Ray's coefficients are of x², y², z²; xy, xz, yz; x, y, z; 1."""
    size = pov_size([shape.lower, shape.upper])
    powers = np.repeat([size * size, size, 1.0], [6, 3, 1])
    a, b, c, d, e, f, *linear = powers * shape.coefficients
    terms = ",".join(map(pov_vector, ((a, b, c), (d, f, e), linear[:3])))
    whole = f"quadric {{ {terms}, {float(linear[3])!r}"
    corners = np.array([shape.lower, shape.upper]) / size
    box = f"box {{ {', '.join(map(pov_vector, corners))} }}"
    text = f"{whole} clipped_by {{ {box} }}"
    if shape.capped:
        text = f"intersection {{ {whole} }} {box}"
    return PovShape(text, size * np.eye(3, 4))


QUADRIC = ShapeType(
    of=Quadric,
    table=TableType(
        field="quadrics",
        crossings=_crossings,
        features=partial(_lengths, of_normals=False),
        bends=partial(_lengths, of_normals=True),
    ),
    surface=surface_of,
    to_mitsuba=_to_mitsuba,
    triangles=_triangles,
    encloses=is_capped,
    to_povray=_to_povray,
)

"""What cylinders and cones share: a side of revolution about the z axis, and its caps."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from comparisons.geometry import affine
from comparisons.mitsuba.hits import Plugin, same_uv
from comparisons.renderers import NoCounterpartError
from comparisons.shapes.fine import FINE, fan, fine, on_circle, widened
from comparisons.shapes.meshing import region
from comparisons.shapes.shape import PovShape, RaysectPart, Tessellation, pov_size
from comparisons.shapes.site import Site, to_world, with_mesh_light
from comparisons.shapes.soup import Soup, heights_of, joined
from comparisons.shapes.stand_ins import tessellated
from comparisons.shapes.surface import Patch, Surface
from reference_rt.core.arrays import FloatArray

SIDE = (4096, 8)
"""Cells around a tube as wide as high, and along its side.  That is straight, but Mitsuba's hit on
a triangle of length L and height h is off by some u L² / h along the triangle: with one cell along
the side by 1e-4 of it, seen at a grazing angle by a hundredth."""

FEWEST_AROUND = 64
"""Of tubes 4,096 times as high as wide, and more slender ones: the sag is 1e-3 of the radius."""

RINGS = 32
"""Cells along the side of a textured cone."""

BOTTOM, TOP = 3, 6
"""Face numbers: 0 is the curved surface, the others are 1 + the axis, + 3 on the positive side."""


class Tube(NamedTuple):
    """The radii at the heights low and high, and whether it has caps there."""

    bottom: float
    top: float
    low: float
    high: float
    capped: bool

    @property
    def reach(self) -> float:
        """Half the side of the square over which uv of its caps go."""
        return max(self.bottom, self.top)

    def caps(self) -> list[tuple[int, float, float, float]]:
        """Face, radius, height and the side, -1 or 1, that each cap faces."""
        ends = ((BOTTOM, self.bottom, self.low, -1.0), (TOP, self.top, self.high, 1.0))
        return [end for end in ends if self.capped and end[1] > 0.0]


def tube_for_raysect(tube: Tube) -> list[RaysectPart]:
    """Where it narrows to an end that is no point, a longer cone within a box."""
    bottom, top, height = tube.bottom, tube.top, tube.high - tube.low
    if not tube.capped:
        raise NoCounterpartError("a tube without caps: raysect's primitives are closed")
    place = np.column_stack([np.eye(3), [0.0, 0.0, tube.low]])
    if bottom == top:
        return [RaysectPart("cylinder", (bottom, height), place)]
    if bottom < top:  # turned upside down
        bottom, top = top, bottom
        place = np.column_stack([np.diag([1.0, -1.0, -1.0]), [0.0, 0.0, tube.high]])
    whole = RaysectPart("cone", (bottom, height * bottom / (bottom - top)), place)
    if top == 0.0:
        return [whole]
    # Its bottom is beyond the cone's: two faces in one place would leave a film.
    middle = np.column_stack([np.eye(3), [0.0, 0.0, -0.5 * height]])
    half = (2.0 * bottom, 2.0 * bottom, 1.5 * height)
    return [whole, RaysectPart("box", half, affine.compose(middle, place))]


def tube_for_povray(tube: Tube) -> PovShape:
    """POV-Ray's cylinder or cone, from z = 0 up."""
    height = tube.high - tube.low
    size = pov_size([tube.bottom, tube.top, height])
    bottom, top = tube.bottom / size, tube.top / size
    text = f"cone {{ <0,0,0>, {bottom!r}, <0,0,{height / size!r}>, {top!r}"
    if bottom == top:
        text = f"cylinder {{ <0,0,0>, <0,0,{height / size!r}>, {top!r}"
    place = np.column_stack([size * np.eye(3), [0.0, 0.0, tube.low]])
    return PovShape(text if tube.capped else f"{text} open", place)


def tube_surface(tube: Tube, textured: bool = False) -> Surface:
    """The side, and its ends.  textured: in rings, where it narrows little, so that uv are almost
    linear."""
    bottom, top, low, high, capped = tube
    slope = (top - bottom) / (high - low)

    def value(p: FloatArray) -> FloatArray:
        return np.asarray(np.hypot(p[..., 0], p[..., 1]) - (bottom + slope * p[..., 2]))

    def gradient(p: FloatArray) -> FloatArray:
        rho = np.hypot(p[..., 0], p[..., 1])[..., None]
        out = np.divide(p[..., :2], rho, out=np.zeros_like(p[..., :2]), where=rho > 0.0)
        return np.concatenate([out, np.where(rho > 0.0, -slope, 0.0)], axis=-1)

    most = max(bottom, top)
    cells = _cells(most / (high - low), textured)
    return Surface(
        value,
        gradient,
        middle=(0.0, 0.0, (low + high) / 2.0),
        half=(most, most, (high - low) / 2.0),
        patches=lambda: [Patch(_side(bottom, top, low, high - low), cells, has_uv=True)],
        ends=(np.array([-np.inf, -np.inf, low]), np.array([np.inf, np.inf, high])),
        capped=capped,
    )


def _cells(slender: float, textured: bool) -> tuple[int, int]:
    """Around and along the side of a tube whose radius over its height is `slender`: as many and as
    long ones on a wire, whose sag is then about the same part of its height.  Powers of two, by
    which k / n is exact, so that caps end where the side does."""
    around = max(FEWEST_AROUND, 2 ** round(math.log2(SIDE[0] * min(1.0, slender**0.5))))
    along = SIDE[0] * SIDE[1] // around
    return around, max(along, RINGS) if textured else along


def _side(
    bottom: float, top: float, z: float, height: float
) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """The side of a cone or a cylinder that starts at z: (u, v) -> points."""

    def point(u: FloatArray, v: FloatArray) -> FloatArray:
        phi, r = 2.0 * np.pi * u, bottom + (top - bottom) * v
        return np.stack([r * np.cos(phi), r * np.sin(phi), z + height * v], axis=-1)

    return point


def cap_plugins(tube: Tube, m: affine.Affine, site: Site) -> list[Plugin]:
    return [cap(m, radius, z, face, tube.reach, site) for face, radius, z, _ in tube.caps()]


def cap(m: affine.Affine, radius: float, z: float, face: int, reach: float, site: Site) -> Plugin:
    """A cap across the axis; its uv are x and y over a square of half side `reach`."""
    if site.textured:
        return _cap_of_triangles(m, radius, z, face, reach, site)
    place = followed(m, np.array([radius, radius, radius]), z)
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


def _cap_of_triangles(
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


def followed(m: affine.Affine, scale: FloatArray, z: float) -> affine.Affine:
    """The map that scales, moves along z, then applies m."""
    return affine.compose(np.column_stack([np.diag(scale), (0.0, 0.0, z)]), m)


def tube_triangles(tube: Tube, m: affine.Affine) -> Tessellation:
    """The side, and fans about the axis, whose rims are those of the side."""
    surface = tube_surface(tube)
    parts, distance = tessellated(surface, m)
    (side,) = surface.patches()
    u = np.arange(side.cells[0]) / side.cells[0]
    k = np.arange(len(u))
    for face, _, _, _ in tube.caps():
        rim = side.point(u, np.full_like(u, float(face == TOP)))
        positions = np.vstack([[[0.0, 0.0, rim[0, 2]]], rim])
        faces = np.column_stack([np.zeros_like(k), 1 + k, 1 + (k + 1) % len(k)])
        faces = faces if face == TOP else faces[:, ::-1]
        uvs = 0.5 * (1.0 + positions[:, :2] / tube.reach)
        parts.append(Soup(positions, uvs=uvs, faces=faces))
    return parts, distance


def unwrapped(uv: FloatArray) -> FloatArray:
    """A point of the unit circle, and v."""
    u, v = uv.T
    return np.column_stack([on_circle(u, np.ones_like(u)), v])


def tube_for_cycles(tube: Tube) -> Soup:
    n = 4 * FINE
    wide = tube._replace(bottom=widened(n) * tube.bottom, top=widened(n) * tube.top)
    # The normals are those of the tube itself.
    surface = tube_surface(tube)._replace(patches=tube_surface(wide).patches)
    parts = [fine(surface, (n, 1 if tube.bottom == tube.top else 16))]
    parts += [fan(radius, z, sign, tube.reach) for _, radius, z, sign in tube.caps()]
    return joined(parts)

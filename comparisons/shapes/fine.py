"""Triangles for Cycles, which has no curved shapes: fine enough that no picture shows them."""

import numpy as np

from comparisons.shapes.meshing import meshed
from comparisons.shapes.soup import Soup
from comparisons.shapes.surface import Surface
from reference_rt.core.arrays import FloatArray

FINE = 256
"""Cells of a full turn.  Points are on the surface, and the middle of a cell's side is
1 - cos(pi / FINE) = 7.5e-5 of the radius inside; `widened` halves it."""


def widened(n: int) -> float:
    """A factor on the radius of n points of a circle: half of it lies outside, as much inside."""
    return float(2.0 / (1.0 + np.cos(np.pi / n)))


def fine(surface: Surface, cells: tuple[int, int]) -> Soup:
    """The surface's patches in so many cells; triangles without an area, at a pole, are left
    out."""
    patches = [patch._replace(cells=cells) for patch in surface.patches()]
    soup = meshed(surface._replace(patches=lambda: patches), 1.0)
    corners = soup.positions[soup.faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.ptp(soup.positions, axis=0).max()
    soup.faces = soup.faces[np.linalg.norm(area, axis=1) > 1e-12 * size**2]
    return soup


def on_circle(turns: FloatArray, radius: FloatArray) -> FloatArray:
    """x, y (n, 2)."""
    phi = 2.0 * np.pi * turns
    return np.column_stack([radius * np.cos(phi), radius * np.sin(phi)])


def fan(radius: float, z: float, sign: float, half: float | None = None) -> Soup:
    """A disk that faces sign z.  half: of the side of the square over which its texture coordinates
    are x and y."""
    n = 4 * FINE
    k = np.arange(n)
    rim = radius * widened(n) * on_circle(k / n, np.ones(n)) * [1.0, sign]
    vertices = np.vstack([[0.0, 0.0, z], np.column_stack([rim, np.full(n, z)])])
    faces = np.column_stack([np.zeros(n, np.int64), k + 1, (k + 1) % n + 1])
    if half is None:
        return Soup(vertices, faces=faces)
    normals = np.tile([0.0, 0.0, sign], (n + 1, 1))
    return Soup(vertices, normals, (vertices[:, :2] / half + 1.0) / 2.0, faces=faces)

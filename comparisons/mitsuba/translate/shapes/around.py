"""Texture coordinates of a quadric's mesh: the angle around z, and z or the angle from it.

They have a seam and poles, where interpolating between a triangle's corners would go wrong: so the
mesh is cut along the seam, and each triangle has corners of its own.
"""

import numpy as np

from comparisons.mitsuba.translate.shapes.cutting import cut_away
from comparisons.mitsuba.translate.shapes.meshes import Soup
from comparisons.mitsuba.translate.shapes.patches import Box
from reference_rt.core.arrays import FloatArray


def around_z(soup: Soup, box: Box) -> Soup:
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

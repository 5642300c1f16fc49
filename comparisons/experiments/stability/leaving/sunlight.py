"""A shape in sunlight: shadows where there are none are seen as speckle."""

import numpy as np

from comparisons.experiments.stability.harness.series import Draw
from comparisons.experiments.stability.harness.shadows import PIXELS, light_picture, lit
from comparisons.experiments.stability.harness.shots import Shot, pixel_grid
from comparisons.experiments.stability.leaving.shapes import Extent, Placed, place, scene_of
from reference_rt.core.arrays import FloatArray


def shoot(contestant: str, kind: str, extent: Extent, draw: Draw) -> Shot:
    """One of a kind in a sun that stands beside the eye: everything seen is lit, but what lies on
    the far side of its terminator."""
    placed = place(kind, extent, draw)
    o, d = _view(placed)
    sun = np.array([0.6, 0.48, 0.64]) @ _frame(placed).T
    w = np.tile(sun, (len(o), 1))
    found = lit(contestant, scene_of(placed), o, d, w)
    dark = int((found[:, 0] == 0.0).sum())
    caption = (
        f"{contestant}: a {kind} in sunlight, {dark:,} of {int((found[:, 0] >= 0.0).sum()):,} "
        "points in shadow"
    )
    return Shot(light_picture(found), caption)


def _frame(placed: Placed) -> FloatArray:
    """The axes of a shape, unit; as good as perpendicular."""
    return np.asarray(placed.linear / np.linalg.norm(placed.linear, axis=0))


def _view(placed: Placed) -> tuple[FloatArray, FloatArray]:
    """Parallel rays (n, 3) along the shape's own -z, in its own proportions."""
    x, y = pixel_grid(PIXELS, 1.3)
    local = np.column_stack([x, y, np.full(x.size, 3.0)])
    d = np.tile(-_frame(placed)[:, 2], (x.size, 1))
    return local @ placed.linear.T + placed.center, d

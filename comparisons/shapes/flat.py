"""What rectangles, disks, planes and polygons share: a plane with coordinates x and y."""

from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons.mitsuba.node import Node
from comparisons.mitsuba.parse import as_transform
from comparisons.shapes.reading_maps import composed, scaled, transform_of
from comparisons.shapes.shape import OwnPlugin
from comparisons.shapes.surface import Surface
from reference_rt.core.arrays import FloatArray


def flat(
    half: float, outline: Callable[[FloatArray], FloatArray] | None = None, is_full: bool = True
) -> Surface:
    """In the plane z = 0, within a square of this half side."""
    return Surface(
        lambda q: np.asarray(q[..., 2]),
        lambda q: np.broadcast_to([0.0, 0.0, 1.0], q.shape),
        (0.0, 0.0, 0.0),
        (half, half, 0.0),
        is_full,
        outline=outline,
    )


def on_plane(table: Any, xy: FloatArray) -> FloatArray:
    """The points (n, 3) of a row's plane with these coordinates (n, 2)."""
    edges = np.array([table.x_edge[0], table.y_edge[0]])
    return np.asarray(table.center[0] + xy @ edges)


def unit_lengths(table: Any) -> list[float]:
    """How far apart the lines x = 0 and x = 1 are, and y = 0 and y = 1."""
    return [float(1.0 / np.linalg.norm(getattr(table, k)[0])) for k in ("x_of", "y_of")]


def flat_transform(node: Node) -> Any:
    """The transform of an element in the plane z = 0; flipping its normal mirrors z."""
    m = node.transform()
    if node.flag("flip_normals"):
        return transform_of(composed(m, scaled(np.zeros(3), np.diag([1.0, 1.0, -1.0]))))
    return as_transform(node.written(), m)


def as_written(plugin: str) -> Callable[[Any, FloatArray, bool], OwnPlugin]:
    """`ShapeType.own_plugin` of a shape without numbers of its own."""
    return lambda shape, linear, textured: (plugin, {})

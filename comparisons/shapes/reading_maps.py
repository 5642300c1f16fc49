"""Maps of Mitsuba's elements as transforms of ours."""

from typing import Any

import numpy as np

from comparisons.geometry.affine import Affine
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.parse import as_transform
from reference_rt.core.arrays import FloatArray
from reference_rt.shapes import Quadric, Shape

TOLERANCE = 1e-5
"""Of a similarity, relative: XML has about six digits, Mitsuba's own tolerance is 1e-6 of 1."""


def transform_of(m: Affine) -> Any:
    """The map as our transform."""
    return as_transform(None, m)


def composed(*maps: FloatArray) -> Affine:
    """The product of maps (3, 4): the last one is applied first, as in Mitsuba's source."""
    total = np.eye(4)
    for m in maps:
        total = total @ np.vstack([m, [0.0, 0.0, 0.0, 1.0]])
    return total[:3]


def scaled(center: FloatArray, linear: FloatArray) -> FloatArray:
    return np.column_stack([linear, center])


def turned_inside_out(
    reading: Reading,
    node: Node,
    material: str | None,
    form: Any,
    lower: tuple[float, float, float],
    upper: tuple[float, float, float],
    m: Affine,
) -> Shape:
    """A quadric, for a sphere or a cylinder whose front is inside; it has other uv."""
    if reading.uses_uv(material):
        raise node.error(
            "is turned inside out ('flip_normals', or a mirroring 'to_world') and has a texture or "
            "a grain, which is not supported: the quadric that stands in for it has other texture "
            "coordinates; expected a mesh, or a plain material"
        )
    return Quadric(
        coefficients=form, lower=lower, upper=upper, transform=transform_of(m), material=material
    )

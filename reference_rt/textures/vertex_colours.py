"""Vertex colour texture: the colours of a mesh's vertices, interpolated."""

from pathlib import Path
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Colour, Examples, Positive
from reference_rt.core.vec3 import Vec3, row
from reference_rt.jit.kernel import kernel
from reference_rt.textures.texture import Texture


class VertexColours(Texture):
    """The colours of a mesh's vertices, interpolated; the `uv` map and the `uv_set` are ignored."""

    EXAMPLES: ClassVar[Examples] = ({}, {"without": (0.2, 0.4, 0.6), "scale": 0.5})
    type: Literal["vertex_colours"] = "vertex_colours"
    without: Colour = (0.5, 0.5, 0.5)
    """The colour of shapes without vertex colours: linear sRGB of at least 0."""
    scale: Positive = 1.0
    """A factor of the vertex colours."""

    def tabulate(self, folder: Path) -> "VertexColourTable":
        return VertexColourTable(np.array([self.without]), np.array([self.scale]))


class VertexColourTable(NamedTuple):
    """without (n, 3), scale (n,)."""

    without: FloatArray
    scale: FloatArray


def greatest(table: VertexColourTable) -> float:
    """The largest value of any channel; the readers of meshes ensure that colours are at most 1."""
    return float(max(table.without.max(), table.scale.max()))


@kernel
def lookup(table: VertexColourTable, i: int, colour: Vec3) -> Vec3:
    """The colour at a point with the interpolated colour `colour`, negative for none."""
    if colour.x < 0.0:
        return row(table.without, i)
    scaled: Vec3 = colour * table.scale[i]
    return scaled

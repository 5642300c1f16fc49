"""Vertex colours: those that a mesh brings for its corners, interpolated."""

from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Colour, Positive
from reference_rt.textures.texture import Texture


class VertexColours(Texture):
    """The colours of a mesh's vertices; its `uv` map has no meaning."""

    type: Literal["vertex_colours"] = "vertex_colours"
    without: Colour = (0.5, 0.5, 0.5)
    """The colour of what has no vertex colours."""
    scale: Positive = 1.0
    """What vertex colours are multiplied with."""

    def tabulate(self, folder: Path) -> "VertexColourTable":
        return VertexColourTable(np.array([self.without]), np.array([self.scale]))


class VertexColourTable(NamedTuple):
    """without (n, 3), scale (n,)."""

    without: FloatArray
    scale: FloatArray


def greatest(table: VertexColourTable) -> float:
    """Colours of meshes are at most 1: their readers see to it."""
    return float(max(table.without.max(), table.scale.max()))

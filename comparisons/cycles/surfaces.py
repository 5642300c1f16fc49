"""Shapes as triangles for Cycles, which has no curved ones."""

from pathlib import Path
from typing import Any

from comparisons.geometry import affine
from comparisons.renderers import NoCounterpartError
from comparisons.shapes import type_of
from comparisons.shapes.soup import Soup


def type_name(shape: Any) -> str:
    """As scene files name it."""
    return str(shape.type)


def triangles_of(shape: Any, folder: Path) -> Soup:
    """The mesh of a shape, before its transform.  Raises NoCounterpartError."""
    to_cycles = type_of(shape).to_cycles
    if to_cycles is None:
        raise NoCounterpartError(f"the shape {type_name(shape)}")
    return to_cycles(shape, folder)


def placed_arrays(soup: Soup, m: affine.Affine) -> dict[str, Any]:
    """The arrays of a mesh under a map, normals and uv by corner; its front stays its front."""
    faces = soup.faces[:, ::-1] if affine.mirrors(m) else soup.faces
    found = {"vertices": affine.apply_points(m, soup.positions), "faces": faces}
    if soup.normals is not None:
        found["normals"] = affine.apply_normals(m, soup.normals[faces.ravel()])
    if soup.uvs is not None:
        found["uv"] = soup.uvs[faces.ravel()]
    return found

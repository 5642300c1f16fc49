"""Joins the parts of a scene file to one mesh."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray
from reference_rt.shapes.meshes.files.data import RawMesh

LIMIT = 2**24
"""The most vertices, and triangles: about 1 GB.  A small file can name the same part any number of
times and must not fill the memory."""


def joined(parts: Iterable[tuple[RawMesh, transform.Affine]]) -> RawMesh:
    """Parts, each with its map (3, 4) to the scene.

    Normals, uv and colours that not all parts have are ignored.  For a map that flips orientation
    the winding is reversed, so that the front stays outside.  Raises ValueError for indices beyond
    their own part.
    """
    vertices, faces, n_vertices, n_faces = [], [], 0, 0
    others: dict[str, list[npt.NDArray[Any] | None]] = {"normals": [], "uv": [], "colours": []}
    names: dict[str, None] = {}  # a set in the order of the parts
    for part, m in parts:
        f = part.faces.astype(np.int64)
        if f.size and not 0 <= f.min() <= f.max() < len(part.vertices):
            raise ValueError(
                f"a part of {len(part.vertices)} vertices has indices {f.min()} to {f.max()}"
            )
        n_faces += len(f)
        if max(n_vertices + len(part.vertices), n_faces) > LIMIT:
            raise ValueError(f"its parts have more than {LIMIT} vertices or triangles")
        mirrored = np.linalg.det(m[:, :3]) < 0.0
        vertices.append(transform.apply_points(m, part.vertices.astype(np.float64)))
        normals = part.normals
        if normals is not None:
            normals = transform.apply_normals(m, normals.astype(np.float64))
        faces.append(n_vertices + (f[:, ::-1] if mirrored else f))
        n_vertices += len(part.vertices)
        for name, found in (("normals", normals), ("uv", part.uv), ("colours", part.colours)):
            others[name].append(found)
        names |= dict.fromkeys(part.ignored)
    if not vertices:
        return RawMesh(np.zeros((0, 3)), np.zeros((0, 3), np.int64))
    for name, values in others.items():
        if any(v is None for v in values) and any(v is not None for v in values):
            names[f"{name} of some parts"] = None
    return RawMesh(
        np.concatenate(vertices),
        np.concatenate(faces),
        normals=_all_or_none(others["normals"]),
        uv=_all_or_none(others["uv"]),
        colours=_all_or_none(others["colours"]),
        ignored=tuple(names),
    )


def _all_or_none(values: list[npt.NDArray[Any] | None]) -> FloatArray | None:
    found = [v for v in values if v is not None]
    return np.concatenate(found, dtype=np.float64) if len(found) == len(values) else None

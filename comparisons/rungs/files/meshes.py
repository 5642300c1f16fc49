"""Meshes against second readers of their files."""

from pathlib import Path
from typing import Any

import numpy as np

from comparisons.geometry import affine
from comparisons.mitsuba.second import Corners, by_second, by_us
from comparisons.rungs.files.findings import Findings, text
from reference_rt.core.arrays import IntArray
from reference_rt.shapes import Mesh, Triangle
from reference_rt.shapes.shape import TabulationContext

FLOAT32 = 2.0**-24
"""The rounding of the numbers that Mitsuba holds."""

LEAST32 = 2.0**-126
"""The least number that float32 holds with all of its bits."""

MOST_TRIANGLES = 4_000_000
"""Triangles of a scene after which no further mesh is checked: these take some seconds."""


def check_mesh(where: str, mesh: Mesh | Triangle, folder: Path, findings: Findings) -> None:
    if findings.triangles > MOST_TRIANGLES:
        findings.unread.append(f"meshes beyond {MOST_TRIANGLES:,} triangles")
        return
    if isinstance(mesh, Mesh) and mesh.file is not None:
        where = where.replace("(mesh)", f"({mesh.file})")
    table = mesh.tabulate(TabulationContext(folder=folder))
    findings.triangles += len(table.face)
    ours = by_us(mesh, folder)
    second = by_second(mesh, folder, ours)
    if second is not None:
        _compare(where, table, second, affine.of_steps(mesh.transform), findings)
        findings.count("meshes" if isinstance(mesh, Mesh) else "triangles")
        return
    assert isinstance(mesh, Mesh)
    assert mesh.file is not None
    suffix = Path(mesh.file).suffix.lower()
    findings.unread.append(
        f"{suffix} of concave polygons, or with uv and normals in part"
        if ours.doubtful
        else f"{suffix} that no other reader takes, or beyond float32"
    )


def _compare(where: str, table: Any, second: Corners, m: affine.Affine, findings: Findings) -> None:
    """A table of triangles against a second source under a transform."""
    linear, offset, source = m[:, :3], m[:, 3], second.source
    order = [0, 2, 1] if np.linalg.det(linear) < 0.0 else [0, 1, 2]  # the front stays the front
    corners = (second.points @ linear.T + offset)[:, order]
    kept: IntArray = table.face
    if len(kept) and kept.max() >= len(corners):
        findings.differences.append(
            f"{where}: has {kept.max() + 1} triangles; {source} finds {len(corners)}"
        )
        return
    sides = corners[:, 1:] - corners[:, :1]
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    # A product of three rounded numbers, of the size of the coordinates.
    size = np.abs(second.points) @ np.abs(linear).T + np.abs(offset)
    rounding = 4.0 * FLOAT32 * float(size.max(initial=0.0)) + LEAST32 * float(np.abs(linear).max())
    longest = np.linalg.norm(sides, axis=-1).max(axis=1, initial=0.0)
    lost = np.ones(len(corners), bool)
    lost[kept] = False
    if (seen := np.flatnonzero(lost & (area > 8.0 * rounding * (longest + rounding)))).size:
        findings.differences.append(
            f"{where}: lacks triangle {seen[0]} of {len(corners)}, which {source} has"
        )
        return
    normals, condition = second.normals, float(np.linalg.cond(linear))
    bent: Any = 16.0 * FLOAT32 * condition
    if normals is not None:
        normals = normals @ np.linalg.inv(linear)
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        if second.bent is not None:
            bent = (second.bent[kept][:, order] + 2.0**-46) * condition
    uv = second.uv
    of_uv, of_more = (
        4.0 * FLOAT32 * float(np.abs(c).max(initial=1.0)) if c is not None else 0.0
        for c in (uv, second.more_uv)
    )
    for column, what, ours, theirs, most in (
        ("points", "is at", table.vertices, None, rounding),
        ("normals", "has the normal", table.normals, normals, bent),
        ("uv", "has the uv", table.uvs, uv, of_uv),
        ("more_uv", "has the uv of further sets", table.more_uvs, second.more_uv, of_more),
        ("colours", "has the colour", table.colours, second.colours, 4.0 * FLOAT32),
    ):
        expected = corners[kept] if column == "points" else None
        if theirs is not None:
            expected = theirs[kept][:, order]
        if expected is None:
            # Mirrored triangles without uv get some, so that these keep their place.
            made = column in second.silent or (column == "uv" and order != [0, 1, 2])
            if ours is not None and not made:
                findings.differences.append(f"{where}: has {column}; {source} finds none")
        elif ours is None:
            findings.differences.append(f"{where}: no corner {what} that {source} finds")
        else:
            ours = ours.reshape(expected.shape)
            error = np.abs(ours - expected).max(axis=-1) - most
            if (error > 0.0).any():
                k, corner = np.unravel_index(int(error.argmax()), error.shape)
                findings.differences.append(
                    f"{where}: corner {corner} of triangle {kept[k]} {what} "
                    f"{text(ours[k, corner])}; {source} has {text(expected[k, corner])}"
                )

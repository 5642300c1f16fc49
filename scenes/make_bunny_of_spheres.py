"""Covers a mesh with spheres: a scene of 100,000 shapes, too large to be kept.

`python scenes/make_bunny_of_spheres.py bunny.obj spheres.json` gives the same bytes always.
"""

import json
import math
import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt

from reference_rt.shapes.meshes.files import read_mesh

Array = npt.NDArray[np.float64]


def points_on(triangles: Array, n: int) -> Array:
    """n points (n, 3), uniform over the area of triangles (m, 3, 3)."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    rng = np.random.default_rng(0)
    which = rng.choice(len(areas), n, p=areas / areas.sum())
    root, v = np.sqrt(rng.random((n, 1))), rng.random((n, 1))
    return (1 - root) * a[which] + root * (1 - v) * b[which] + root * v * c[which]


def scene(mesh: Path, n: int = 100_000) -> str:
    """The JSON of a scene of n spheres on a mesh's surface, which they about cover once."""
    data = read_mesh(mesh)
    triangles = data.vertices[data.faces]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = float(0.5 * np.linalg.norm(normals, axis=1).sum())
    radius = math.sqrt(area / (math.pi * n))
    centers = points_on(triangles, n)
    lower, upper = centers.min(axis=0), centers.max(axis=0)
    middle, size = 0.5 * (lower + upper), float(np.linalg.norm(upper - lower))
    camera = {
        "type": "perspective",
        "eye": (middle + size * np.array([0.0, 0.3, 1.4])).round(6).tolist(),
        "target": middle.round(6).tolist(),
        "fov": 40,
    }
    spheres = [
        {"type": "sphere", "center": p, "radius": round(radius, 9)}
        for p in centers.round(9).tolist()
    ]
    return json.dumps(
        {
            "description": f"{n:,} spheres on the surface of {mesh.name}",
            "camera": camera,
            "film": {"width": 256, "height": 256},
            "integrator": {"type": "ray_cast", "show": "normal"},
            "shapes": spheres,
        }
    )


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python make_bunny_of_spheres.py MESH SCENE.json")
    Path(sys.argv[2]).write_text(scene(Path(sys.argv[1])))

"""Volumes by chords against those of another kernel."""

from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness import solids
from comparisons.experiments.stability.harness.meshes import write_smallest_ball
from comparisons.experiments.stability.harness.outcomes import OURS, Outcome, Outcomes
from comparisons.experiments.stability.harness.series import Draw, Sweep, series
from comparisons.experiments.stability.solids.trees import Shapes, Tree, leaf, placed
from reference_rt.core import transform
from reference_rt.shapes.meshes.files import read_mesh

BEAM = 10_000
HALF = 2.5
"""Half the side of the square beam: no operand reaches further."""

SIGMAS = 4.0
"""A right answer is further off once in 16 000 solids."""


@series(Sweep("operands", tuple(2.0**k for k in range(1, 7)), (4.0,), 2, 8), unit="standard errors")
def volume(draw: Draw, x: float) -> Outcomes:
    """Boxes and closed meshes together and without each other: the mean length of parallel chords
    against the volume that manifold3d finds; more than 4 standard errors off breaks the law."""
    write_smallest_ball(draw.folder)
    off: dict[str, list[float]] = {OURS: [], solids.INTERVALS: []}
    for _ in range(draw.cases):
        shapes, tree, expected = _solid(draw, int(x))
        o = np.column_stack([draw.rng.uniform(-HALF, HALF, (BEAM, 2)), np.full(BEAM, -10.0)])
        d = np.tile([0.0, 0.0, 1.0], (BEAM, 1))
        solid = shapes.solid(tree)
        for name in off:
            t = solids.LISTS[name](solid, draw.folder, o, d)
            even = t[:, : t.shape[1] // 2 * 2]
            chords = np.where(np.isfinite(even), even, 0.0)
            length = (chords[:, 1::2] - chords[:, 0::2]).sum(axis=1) * (2.0 * HALF) ** 2
            error = max(float(length.std()) / np.sqrt(BEAM), 1e-300)
            off[name].append(abs(float(length.mean()) - expected) / error)
    return {
        name: Outcome(len(some), int(np.count_nonzero(np.array(some) > SIGMAS)), max(some))
        for name, some in off.items()
    }


def _solid(draw: Draw, operands: int) -> tuple[Shapes, Tree, float]:
    """Shapes, a tree of all, and its volume."""
    import manifold3d

    leaves, parts = [], []
    size = 1.2 * operands ** (-1.0 / 3.0)
    for k in range(operands):
        kind = ("box", "mesh")[k % 2]
        shape = leaf(draw.rng, kind, placed(draw.rng, size * (0.7 if kind == "box" else 1.0), 0.7))
        leaves.append(shape)
        parts.append(_manifold(manifold3d, draw, shape))
    tree: Tree = 0
    whole = parts[0]
    for k in range(1, operands):
        operation = str(draw.rng.choice(["|", "|", "-", "|"])) if k > 1 else "|"
        tree = (operation, tree, k)
        whole = whole + parts[k] if operation == "|" else whole - parts[k]
    return Shapes(leaves), tree, float(whole.volume())


def _manifold(manifold3d: Any, draw: Draw, shape: Any) -> Any:
    m = transform.affine(shape.transform)
    if isinstance(shape, rt.Box):
        cube = manifold3d.Manifold.cube((2.0, 2.0, 2.0), True)
        return cube.transform(m)
    data = read_mesh(draw.folder / shape.file)
    points = transform.apply_points(m, data.vertices)
    mesh = manifold3d.Mesh64(points, data.faces.astype(np.uint64))
    return manifold3d.Manifold(mesh)

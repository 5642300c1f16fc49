"""Shapes against the equation of their description, where our tracer meets them."""

import numpy as np

from comparisons.geometry import affine
from comparisons.rungs.files.findings import Findings, text
from comparisons.shapes import type_of
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.scene import Scene
from reference_rt.shapes.shape import Shape

RAYS = 64
"""Rays at a shape without a table of corners."""


def check_equation(where: str, shape: Shape, findings: Findings) -> None:
    """Rays at places within the shape, from everywhere; they must meet it where its equation holds,
    and reach as far as it does."""
    of = type_of(shape)
    assert of.surface is not None
    surface, m = of.surface(shape), affine.of_steps(shape.transform)
    linear, offset = m[:, :3], m[:, 3]
    inverse = np.linalg.inv(linear)
    rng = np.random.default_rng(38)
    half, middle = np.array(surface.half), np.array(surface.middle)
    size = float(np.linalg.norm(half))
    target = middle + half * rng.uniform(-0.95, 0.95, (RAYS, 3))
    begin = middle + 4.0 * size * _unit(rng.normal(size=(RAYS, 3)))
    o, d = begin @ linear.T + offset, (target - begin) @ linear.T
    bare = dict.fromkeys(("material", "interior", "exterior"))
    hits = Scene(shapes=(shape.model_copy(update=bare),)).intersect(o, d)
    findings.count(of.table.field if of.table else f"{type(shape).__name__.lower()}s")
    if not hits.hit.any():
        if surface.is_full:
            findings.differences.append(f"{where}: rays do not meet it where its description is")
        return
    q = (hits.p[hits.hit] - offset) @ inverse.T
    # Our points are right to some ulp of the coordinates, in the world, seen in the shape's space.
    reach = float(np.abs(hits.p[hits.hit]).max() + np.abs(offset).max())
    rounding = 2.0**-40 * (size + np.linalg.norm(inverse, 2) * reach)
    error = surface.distance(q)
    p, n = hits.p[hits.hit], hits.n[hits.hit]
    k = int(error.argmax())
    if error[k] > rounding:
        findings.differences.append(
            f"{where}: is met at {text(p[k])}, {error[k]:.3g} off the surface that is described, "
            "in its own space"
        )
        return
    gradient = surface.normals(q)
    is_smooth = np.linalg.norm(gradient, axis=1) > 0.0
    p, n, expected = p[is_smooth], n[is_smooth], _unit(gradient[is_smooth] @ inverse)
    # Mirrored shapes keep the front of their description.
    off = np.linalg.norm(expected - n, axis=1)
    if len(off) and off.max() > 3e-5 + 16.0 * rounding / size:
        k = int(off.argmax())
        findings.differences.append(
            f"{where}: has the normal {text(n[k])} at {text(p[k])}; expected {text(expected[k])}"
        )


def _unit(v: FloatArray) -> FloatArray:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))

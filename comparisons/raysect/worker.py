"""Traces rays through solids by raysect: run as a program.

Standard input: a JSON object.  solids: what to trace, see below;  rays: an .npz file with origins o
and unit directions d (n, 3);  out: the .npz file to write: t (n,), inf for a miss, solid (n,), its
number or -1, normal (n, 3), unit, outwards.

A solid is a node.  of a list of nodes, and type union, intersection or difference: their
combination;  else type and sizes, lengths, of a primitive, and map (3, 4), its place.
"""

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from raysect.core import AffineMatrix3D, Point3D, Ray, Vector3D, World
from raysect.primitive import Box, Cone, Cylinder, Intersect, Sphere, Subtract, Torus, Union

Node = Mapping[str, Any]

_COMBINED = {"union": Union, "intersection": Intersect, "difference": Subtract}

_PRIMITIVES: dict[str, Callable[..., Any]] = {
    "sphere": Sphere,
    "box": lambda x, y, z, **place: Box(Point3D(-x, -y, -z), Point3D(x, y, z), **place),
    "cylinder": Cylinder,
    "cone": Cone,
    "torus": Torus,
}
"""From `sizes`: the radius; half the sides; radius and height, from z = 0 up; the same; the major
and the minor radius."""


def _made(node: Node) -> Any:
    if "of" in node:
        first, *others = map(_made, node["of"])
        for other in others:
            first = _COMBINED[node["type"]](first, other)
        return first
    rows = [*node["map"], [0.0, 0.0, 0.0, 1.0]]
    return _PRIMITIVES[node["type"]](*node["sizes"], transform=AffineMatrix3D(rows))


def trace(solids: Sequence[Node], o: Any, d: Any) -> dict[str, Any]:
    """What is written, as arrays by name."""
    world, numbers = World(), {}
    for k, node in enumerate(solids):
        made = _made(node)
        made.parent = world
        numbers[made] = k
    t, solid, normal = np.full(len(o), np.inf), np.full(len(o), -1), np.zeros((len(o), 3))
    for k, (start, way) in enumerate(zip(o.tolist(), d.tolist(), strict=True)):
        hit = world.hit(Ray(Point3D(*start), Vector3D(*way)))
        if hit is not None:
            t[k], solid[k] = hit.ray_distance, numbers[hit.primitive]
            n = hit.normal.transform(hit.primitive_to_world)
            normal[k] = np.array((n.x, n.y, n.z)) / n.length
    return {"t": t, "solid": solid, "normal": normal}


if __name__ == "__main__":
    asked = json.load(sys.stdin)
    with np.load(asked["rays"]) as rays:
        np.savez(asked["out"], **trace(asked["solids"], rays["o"], rays["d"]))

"""Shapes of Mitsuba scenes, with the normals, uv and sides that Mitsuba gives them."""

from typing import Any

import numpy as np

from comparisons.lights.area import emission
from comparisons.materials.reading import material_name
from comparisons.media import media_names
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.parse import as_transform
from comparisons.shapes import SHAPES
from reference_rt.materials import Emissive
from reference_rt.shapes import Mesh, Shape
from reference_rt.shapes.instances import Instance
from reference_rt.shapes.meshes.triangle_table import geometric_normals

READERS = {plugin: reader for one in SHAPES for plugin, reader in one.from_mitsuba.items()}


def read_shape(reading: Reading, node: Node) -> None:
    """Add a shape to the scene; a group only to its groups."""
    if node.plugin == "shapegroup":
        group_name(reading, node)
        return
    reading.shapes += _shapes(reading, node)


def _shapes(reading: Reading, node: Node, in_group: bool = False) -> list[Shape]:
    """The shape of an element; the children of `merge`, which only joins meshes."""
    if node.plugin != "merge":
        seen = [] if _is_nothing(node) else [shape(reading, node, in_group)]
        if any(isinstance(part, Mesh) and _area(part) == 0.0 for part in seen):
            seen = []
        if not seen:
            reading.note(node, "has no area under 'to_world', and is left out")
        return seen
    reading.note(node, "is read as the shapes inside it")
    found = [part for child in node.children("Shape") for part in _shapes(reading, child, in_group)]
    node.finish()
    return found


def _is_nothing(node: Node) -> bool:
    """Whether 'to_world' leaves nothing of a shape that Mitsuba hits."""
    # Mitsuba's points and vectors have a `matrix` too: six numbers.
    matrix = np.array(getattr(node.properties.get("to_world"), "matrix", np.eye(4)), np.float64)
    if matrix.shape != (4, 4) or not np.isfinite(matrix[:3, :3]).all():
        return False  # which is an error of the shape's own reader
    linear = matrix[:3, :3]
    rank = np.linalg.matrix_rank(linear)
    if node.plugin in ("rectangle", "disk"):
        return bool(np.linalg.matrix_rank(linear[:, :2]) < 2)
    # Of a line, Mitsuba makes round spheres and cylinders.
    return bool(rank < (1 if node.plugin in ("sphere", "cylinder", "instance") else 2))


def _area(mesh: Mesh) -> float:
    """In its own coordinates, or 1 under a transform: that undoes no map which flattens."""
    if mesh.transform:
        return 1.0
    corners = np.asarray(mesh.vertices)[np.asarray(mesh.faces)]
    return float(np.abs(geometric_normals(corners.reshape(-1, 9))).sum())


def shape(reading: Reading, node: Node, in_group: bool = False) -> Shape:
    """The shape of an element.  Raises SceneError."""
    if node.plugin == "instance":
        return _instance(reading, node, in_group)
    if node.plugin not in READERS:
        known = ", ".join(sorted([*READERS, "instance", "shapegroup"]))
        raise node.unsupported(f"expected one of: {known}")
    node.ignore("silhouette_sampling_weight")
    media = media_names(reading, node)
    for sensor in node.children("Sensor"):
        raise sensor.error("belongs to a shape, which is not supported; expected a camera")
    material = _material(reading, node, in_group)
    with node.checking():
        found = READERS[node.plugin](reading, node, material)
    node.finish()
    return found.model_copy(update=media) if media else found


def _material(reading: Reading, node: Node, in_group: bool) -> str | None:
    bsdf, emitter = node.only("BSDF"), node.only("Emitter")
    base = None if bsdf is None else material_name(reading, bsdf)
    if emitter is None:
        return base
    if in_group:
        raise emitter.error("shines in a group, which Mitsuba refuses, too; expected no emitter")
    # Without a BSDF a lamp is black (src/render/shape.cpp).
    key = ("emissive", emitter.index, base)
    if key not in reading.names:
        name = reading.unused(emitter.name, "lamp", reading.materials)
        reading.materials[name] = Emissive(radiance=emission(reading, emitter), base=base)
        reading.names[key] = name
    return reading.names[key]


# ---- groups -------------------------------------------------------------------------------------


def group_name(reading: Reading, node: Node) -> str:
    """The name of a shape group, which is read if it is not yet."""
    key = ("group", node.index)
    if key not in reading.names:
        node.ignore("to_world")  # which Mitsuba does not use, either
        members = [
            part for child in node.children("Shape") for part in _shapes(reading, child, True)
        ]
        if not members:
            raise node.error("has no shapes; expected one or more")
        node.finish()
        name = reading.unused(node.name, "group", reading.groups)
        reading.groups[name] = tuple(members)
        reading.names[key] = name
    return reading.names[key]


def _instance(reading: Reading, node: Node, in_group: bool) -> Shape:
    if in_group:
        raise node.error("is nested in a group, which Mitsuba refuses, too; expected a shape")
    group = node.only("Shape")
    if group is None or group.plugin != "shapegroup":
        raise node.error("has no shape group; expected a reference to one")
    m = node.transform()
    steps: Any = as_transform(node.written(), m)
    found = Instance(group=group_name(reading, group), transform=steps)
    node.finish()
    return found

"""Shapes of Mitsuba scenes, with the normals, uv and sides that Mitsuba gives them."""

from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons.lights.reading import emission
from comparisons.materials.reading import material_name
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.parse import as_transform
from comparisons.shapes.reading_meshes import Surface, finished, is_normal, mesh, placed
from reference_rt.core.arrays import FloatArray
from reference_rt.core.transform import Affine, is_similarity
from reference_rt.materials import Emissive
from reference_rt.shapes import Box, Cylinder, Disk, Mesh, Quadric, Rectangle, Shape, Sphere
from reference_rt.shapes.instances import Instance
from reference_rt.shapes.meshes.triangle_table import geometric_normals

Reader = Callable[[Reading, Node, "str | None"], Shape]

TOLERANCE = 1e-5
"""Of a similarity, relative: XML has about six digits, Mitsuba's own tolerance is 1e-6 of 1."""


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
    if node.plugin not in _READERS:
        known = ", ".join(sorted([*_READERS, "instance", "shapegroup"]))
        raise node.unsupported(f"expected one of: {known}")
    node.ignore("silhouette_sampling_weight")
    for medium in node.children("Medium"):
        raise medium.unsupported("expected a scene without media")
    for sensor in node.children("Sensor"):
        raise sensor.error("belongs to a shape, which is not supported; expected a camera")
    material = _material(reading, node, in_group)
    with node.checking():
        found = _READERS[node.plugin](reading, node, material)
    node.finish()
    return found


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


# ---- single shapes ------------------------------------------------------------------------------


def _steps(m: Affine) -> Any:
    """The map as our transform."""
    return as_transform(None, m)


def _compose(*maps: FloatArray) -> Affine:
    """The product of maps (3, 4): the last one is applied first, as in Mitsuba's source."""
    total = np.eye(4)
    for m in maps:
        total = total @ np.vstack([m, [0.0, 0.0, 0.0, 1.0]])
    return total[:3]


def _scaled(center: FloatArray, linear: FloatArray) -> FloatArray:
    return np.column_stack([linear, center])


def _sphere(reading: Reading, node: Node, material: str | None) -> Shape:
    center, radius = node.vector("center", (0.0, 0.0, 0.0)), node.number("radius", 1.0)
    if not radius > 0.0:
        raise node.error(f"'radius' is {radius:g}; expected more than 0")
    placed_by, flips = node.transform(), node.flag("flip_normals")
    if not flips and is_similarity(placed_by[:, :3]) and np.linalg.det(placed_by[:, :3]) > 0.0:
        steps: Any = as_transform(node.written(), placed_by)
        return Sphere(center=center, radius=radius, transform=steps, material=material)
    m = _compose(placed_by, _scaled(np.array(center), radius * np.eye(3)))
    linear = m[:, :3]
    lengths = np.linalg.norm(linear, axis=0)
    gram = linear.T @ linear
    if np.abs(gram - lengths[0] ** 2 * np.eye(3)).max() > TOLERANCE * lengths.max() ** 2:
        raise node.error(
            "'to_world' makes it an ellipsoid, which Mitsuba renders as a sphere with a warning; "
            "expected a uniform scale, or an instance of a group with the sphere"
        )
    # A map that mirrors turns Mitsuba's spheres inside out, but not its cylinders (measured).
    if flips != bool(np.linalg.det(linear) < 0.0):
        form = (-1.0, -1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
        return _turned(reading, node, material, form, (-1.5, -1.5, -1.5), (1.5, 1.5, 1.5), m)
    return Sphere(transform=_steps(_orthogonal(m, lengths[0])), material=material)


def _orthogonal(m: Affine, size: float) -> Affine:
    """The nearest similarity: what XML has rounded is no exact rotation."""
    u, _, v = np.linalg.svd(m[:, :3] / size)
    return np.column_stack([size * (u @ v), m[:, 3]])


def _cylinder(reading: Reading, node: Node, material: str | None) -> Shape:
    radius = node.number("radius", 1.0)
    p0 = np.array(node.vector("p0", (0.0, 0.0, 0.0)))
    p1 = np.array(node.vector("p1", (0.0, 0.0, 1.0)))
    length = float(np.linalg.norm(p1 - p0))
    if not (radius > 0.0 and length > 0.0):
        raise node.error("'radius' or the distance from 'p0' to 'p1' is 0; expected more")
    turn = _frame((p1 - p0) / length)
    placed_by = node.transform()
    m = _compose(placed_by, _scaled(p0, turn @ np.diag([radius, radius, length])))
    linear = m[:, :3]
    gram = linear.T @ linear
    wanted = np.diag([gram[0, 0], gram[0, 0], gram[2, 2]])
    sizes = np.sqrt(np.diag(gram))
    if (np.abs(gram - wanted) > TOLERANCE * np.outer(sizes, sizes)).any():
        raise node.error(
            "'to_world' makes it oblique or elliptic, which Mitsuba renders as a round cylinder "
            "with a warning; expected one that scales its radius uniformly"
        )
    if not node.flag("flip_normals") and p0[2] < p1[2] and not (p0[:2].any() or p1[:2].any()):
        steps: Any = as_transform(node.written(), placed_by)
        return Cylinder(
            radius=radius,
            z_min=float(p0[2]),
            z_max=float(p1[2]),
            capped=False,
            transform=steps,
            material=material,
        )
    if node.flag("flip_normals"):
        form = (-1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
        return _turned(reading, node, material, form, (-1.5, -1.5, 0.0), (1.5, 1.5, 1.0), m)
    return Cylinder(capped=False, transform=_steps(m), material=material)


def _frame(n: FloatArray) -> FloatArray:
    """(3, 3), whose columns are Mitsuba's tangents of the unit vector n, and n (Duff et al. 2017,
    "Building an Orthonormal Basis, Revisited")."""
    x, y, z = n
    sign = float(np.copysign(1.0, z))
    a = -1.0 / (sign + z)
    b = x * y * a
    s = (1.0 + sign * x * x * a, sign * b, -sign * x)
    t = (b, sign + y * y * a, -y)
    return np.column_stack([s, t, n])


def _turned(
    reading: Reading,
    node: Node,
    material: str | None,
    form: Any,
    lower: tuple[float, float, float],
    upper: tuple[float, float, float],
    m: Affine,
) -> Shape:
    """A quadric, for a sphere or a cylinder whose front is inside; it has other uv."""
    if reading.uses_uv(material):
        raise node.error(
            "is turned inside out ('flip_normals', or a mirroring 'to_world') and has a texture or "
            "a grain, which is not supported; expected another shape or a plain material"
        )
    return Quadric(
        coefficients=form, lower=lower, upper=upper, transform=_steps(m), material=material
    )


def _flat(node: Node) -> Any:
    """The transform of a shape in the plane z = 0; flipping its normal mirrors z."""
    m = node.transform()
    if node.flag("flip_normals"):
        return _steps(_compose(m, _scaled(np.zeros(3), np.diag([1.0, 1.0, -1.0]))))
    return as_transform(node.written(), m)


def _rectangle(reading: Reading, node: Node, material: str | None) -> Shape:
    node.ignore("face_normals")
    return Rectangle(transform=_flat(node), material=material)


def _disk(reading: Reading, node: Node, material: str | None) -> Shape:
    return Disk(transform=_flat(node), material=material)


def _cube(reading: Reading, node: Node, material: str | None) -> Shape:
    node.ignore("face_normals")  # it has vertex normals all the same
    flip = node.flag("flip_normals")
    m, of_normals = node.maps()
    if is_normal(m, of_normals) and not (flip or reading.uses_uv(material)):
        steps: Any = as_transform(node.written(), m)
        return Box(transform=steps, material=material)
    surface = Surface(_CUBE, _CUBE_FACES, _CUBE_NORMALS, _CUBE_UV)
    return finished(placed(surface, m, of_normals, smooth=False), flip, True, material)


_CUBE = np.array(
    [
        *([1, -1, -1], [1, -1, 1], [-1, -1, 1], [-1, -1, -1]),
        *([1, 1, -1], [-1, 1, -1], [-1, 1, 1], [1, 1, 1]),
        *([1, -1, -1], [1, 1, -1], [1, 1, 1], [1, -1, 1]),
        *([1, -1, 1], [1, 1, 1], [-1, 1, 1], [-1, -1, 1]),
        *([-1, -1, 1], [-1, 1, 1], [-1, 1, -1], [-1, -1, -1]),
        *([1, 1, -1], [1, -1, -1], [-1, -1, -1], [-1, 1, -1]),
    ],
    np.float64,
)
_CUBE_NORMALS = np.repeat(
    [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0],
     [0.0, 0.0, -1.0]], 4, axis=0,
)  # fmt: skip
_CUBE_UV = np.tile([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]], (6, 1))
_CUBE_FACES = np.array([[k, k + 1, k + 2] if odd == 0 else [k + 3, k, k + 2]
                        for k in range(0, 24, 4) for odd in (0, 1)])  # fmt: skip
"""Mitsuba's cube (src/shapes/cube.cpp), whose uv are those of no box of ours."""


_READERS: dict[str, Reader] = {
    "sphere": _sphere,
    "cylinder": _cylinder,
    "rectangle": _rectangle,
    "disk": _disk,
    "cube": _cube,
    "obj": mesh,
    "ply": mesh,
    "serialized": mesh,
}

"""Metamorphic relations: changes of a scene that must not change what is seen, each of them once.

| relation | what changes | what must hold |
|---|---|---|
| `moved` | all, p -> factor turn p + offset | rays moved likewise hit the same, at factor t |
| `reordered` | the order of the shapes | the same hits; at one t, either of two shapes |
| `remeshed` | the order of triangles, the meshes that they are in | the same hits |
| `nested` | one map of shapes, or its parts on groups in groups | the same hits |
| `HIERARCHIES` | the acceleration structure | the same hits, and pictures |

Where both scenes have the same numbers, or these times 2^k, it holds to the last bit: an offset of
few digits, a factor 2^k, another order or structure.  Else it holds as far as rounding moves a
surface, which is `REACH`: the users (the fuzzer's `identities`, families F5 and F9) decide in their
own way whether an answer is one of a scene moved by no more than that.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from comparisons.geometry.exact.dyadic import BoolArray
from comparisons.geometry.frame import Frame
from comparisons.translator.moved import moved as in_frame
from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray
from reference_rt.lights import Directional, Goniometric, Point, Spot
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Mesh
from reference_rt.shapes.instances import Instance

REACH = 64.0
"""How far, in u times the largest coordinates, a point may be from where it should: a ray leaves a
surface by 16 sqrt(3) u (anchor + point + size) at most (`reference_rt.core.ray.surface_error`), 56
u of the largest coordinate for what is small beside its distance; the eye, target and lights are
rounded by u each, the point that is shaded by two or three; the maps of shapes on either side take
some thirty operations."""

HIERARCHIES = ("none", "sah", "median", "spatial")

Identities = npt.NDArray[np.int64]
"""(n, 4): shape, instance, part, primitive; all -1 for a miss."""

Names = Callable[[Identities], Identities]
"""What hits in the changed scene are called in the scene before."""


def identities_of(hits: Intersections) -> Identities:
    columns = (hits.shape, hits.instance, hits.part, hits.primitive)
    return np.where(hits.shape[:, None] < 0, -1, np.column_stack(columns))


def differ(a: Identities, b: Identities) -> BoolArray:
    """Which rays (n,) do not hit the same thing."""
    return np.asarray((a != b).any(axis=1))


# ---- all of a scene moved, scaled, turned -------------------------------------------------------


class Motion(NamedTuple):
    """p -> factor turn p + offset.  turn: (3, 3), orthogonal to within rounding."""

    factor: float = 1.0
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: FloatArray = np.eye(3)

    def points(self, p: npt.ArrayLike) -> FloatArray:
        """Of points (n, 3)."""
        affine = np.column_stack([self.factor * self.turn, self.offset])
        return np.asarray(transform.apply_points(affine, np.asarray(p, np.float64)))

    def vectors(self, v: npt.ArrayLike) -> FloatArray:
        """Of vectors (n, 3), which are turned alone."""
        return Motion(turn=self.turn).points(v)


def moved(scene: Scene, motion: Motion) -> Scene:
    """The scene, all of it: shapes, camera and lights; intensities such that it looks the same."""
    if not np.array_equal(motion.turn, np.eye(3)):
        scene = _turned(scene, Motion(turn=motion.turn))
    x, y, z = motion.offset
    center = (-x / motion.factor, -y / motion.factor, -z / motion.factor)
    return in_frame(scene, Frame(center, motion.factor))


def _turned(scene: Scene, turn: Motion) -> Scene:
    def changed(part: Any, *names: str) -> Any:
        found = {name: tuple(turn.points([getattr(part, name)])[0].tolist()) for name in names}
        return part.model_copy(update=found)

    places = {
        Point: ("position",),
        Spot: ("origin", "target"),
        Goniometric: ("origin", "target", "c0"),
        Directional: ("direction",),
    }
    rows = np.column_stack([turn.turn, np.zeros(3)]).tolist()
    step = transform.Matrix.model_validate({"matrix": rows})
    return scene.changed(
        camera=changed(scene.camera, "eye", "target", "up"),
        shapes=tuple(_under(shape, step) for shape in scene.shapes),
        lights=tuple(changed(light, *places.get(type(light), ())) for light in scene.lights),
    )


def _under(shape: Any, *steps: transform.Step) -> Any:
    return shape.model_copy(update={"transform": (*shape.transform, *steps)})


# ---- parts in another order, in other meshes, in groups -----------------------------------------


def reordered(scene: Scene, order: npt.NDArray[Any]) -> tuple[Scene, Names]:
    """Shape k is the one that was order[k]."""
    number = np.append(order, -1)

    def names(found: Identities) -> Identities:
        named = found.copy()
        named[:, 0] = number[found[:, 0]]
        return named

    return scene.changed(shapes=tuple(scene.shapes[k] for k in order)), names


def remeshed(
    scene: Scene, parts: Callable[[int], Sequence[npt.NDArray[np.int64]]]
) -> tuple[Scene, Names] | None:
    """Each mesh outside of groups and solids as one or more meshes of the same vertices; None where
    there is none.  parts: of a number of triangles the numbers of each mesh's triangles."""
    shapes: list[Any] = []
    of: list[tuple[int, npt.NDArray[np.int64] | None]] = []
    for k, shape in enumerate(scene.shapes):
        whole = _with_arrays(shape, scene.folder) if isinstance(shape, Mesh) else None
        numbers = [None] if whole is None else parts(len(whole["faces"]))
        of += [(k, some) for some in numbers]
        shapes += [
            shape if whole is None else Mesh(**whole | {"faces": whole["faces"][some]})
            for some in numbers
        ]

    def names(found: Identities) -> Identities:
        named = found.copy()
        for k, (old, numbers) in enumerate(of):
            rows = found[:, 0] == k
            named[rows, 0] = old
            if numbers is not None:
                named[rows, 3] = numbers[found[rows, 3]]
        return named

    if all(numbers is None for _, numbers in of):
        return None
    return scene.changed(shapes=tuple(shapes)), names


def _with_arrays(mesh: Mesh, folder: Path) -> dict[str, Any] | None:
    """A mesh's fields with its arrays in place of its file; None where a part would not be shaded
    as the whole, whose vertex normals are means over triangles."""
    data = mesh.data(folder)
    if mesh.smooth and data.normals is None:
        return None
    fields = {name: getattr(mesh, name) for name in type(mesh).model_fields if name != "type"}
    return fields | {"file": None} | {name: getattr(data, name) for name in Mesh.array_fields}


def nested(
    scene: Scene, shapes: Sequence[Any], steps: Sequence[transform.Step]
) -> tuple[Scene, Scene, Names]:
    """Of some shapes of a scene, no instances among them: under all steps; as an instance of a
    group of an instance of a group ..., each under a step of its own; and what hits in the latter
    are called in the former."""
    baked = scene.changed(shapes=tuple(_under(shape, *steps) for shape in shapes))
    groups: dict[str, Any] = dict(scene.groups) | {"nested 0": tuple(shapes)}
    for k, step in enumerate(steps[:-1]):
        groups[f"nested {k + 1}"] = (Instance(group=f"nested {k}", transform=(step,)),)
    last = Instance(group=f"nested {len(steps) - 1}", transform=(steps[-1],))

    def names(found: Identities) -> Identities:
        """A shape's number in its group is its number in the scene."""
        named = found.copy()
        hit = found[:, 0] >= 0
        named[hit, 0], named[hit, 1], named[hit, 2] = found[hit, 2], -1, 0
        return named

    return baked, scene.changed(groups=groups, shapes=(last,)), names

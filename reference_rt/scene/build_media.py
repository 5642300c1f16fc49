"""The media of a scene -> Media, and the rows of materials: one for each pair of media at which a
material is a boundary.

A surface's medium is looked up by the row of its material, which every hit has, so that shapes need
no column for it.  The rows of a scene without media are its materials, and the default one.
"""

from collections.abc import Iterator
from typing import NamedTuple

from reference_rt.materials import NoSurface
from reference_rt.media import AnyMedium, Media
from reference_rt.media.tables import UNCHANGED, VACUUM, media_table
from reference_rt.scene.model import SceneModel
from reference_rt.shapes import Shape
from reference_rt.shapes.csg import Solid
from reference_rt.shapes.instances import Instance


class Boundary(NamedTuple):
    """material: its name, None for the default one;  interior, exterior: names of media, as of a
    `Shape`."""

    material: str | None
    interior: str | None = None
    exterior: str | None = None


def boundaries(scene: SceneModel) -> dict[Boundary, int]:
    """The row of each: first the scene's materials in their order, then the default material, then
    those that bound media, in the order of the shapes."""
    found = {Boundary(name): row for row, name in enumerate((*scene.materials, None))}
    if scene.media:
        for shape in (*scene.shapes, *(s for shapes in scene.groups.values() for s in shapes)):
            if not isinstance(shape, Instance):
                for name in set(_materials(shape, None)):
                    found.setdefault(Boundary(name, shape.interior, shape.exterior), len(found))
    return found


def _materials(shape: Shape, above: str | None) -> Iterator[str | None]:
    name = shape.material if shape.material is not None else above
    if not isinstance(shape, Solid):
        yield name
        return
    for operand in shape.of:
        yield from _materials(operand, name)


def media_of(scene: SceneModel) -> Media:
    """The media of a scene, for kernels."""
    numbers = {name: k for k, name in enumerate(scene.media)}
    sides, passes = [], []
    for boundary in boundaries(scene):
        names = boundary.interior, boundary.exterior
        of = VACUUM if any(name is not None for name in names) else UNCHANGED
        inside, outside = (of if name is None else numbers[name] for name in names)
        sides.append((inside, outside))
        material = None if boundary.material is None else scene.materials[boundary.material]
        passes.append(isinstance(material, NoSurface))
    media: list[AnyMedium] = [*scene.media.values()]
    return media_table(media, sides, passes)


def camera_medium(scene: SceneModel) -> int:
    """The number of the medium in which the camera stands."""
    name = scene.camera.medium
    return VACUUM if name is None else [*scene.media].index(name)

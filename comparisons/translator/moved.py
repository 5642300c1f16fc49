"""A scene elsewhere: in its counterpart's frame, every length scaled and every radiance unchanged;
mirrored; and with float32 vertices."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from comparisons.cameras import type_of as type_of_camera
from comparisons.cameras.camera import MIRROR
from comparisons.geometry.frame import Frame, frame_for
from comparisons.lights import type_of as type_of_light
from comparisons.lights.light import Motion, with_steps
from comparisons.mitsuba.node import Node, Reading, Triple, triple
from comparisons.referee.sizes import ShapeSizes
from comparisons.shapes.mesh import soup_of
from comparisons.shapes.soup import Soup
from reference_rt.core.transform import Scale, Translate
from reference_rt.materials import Bump, NormalMap
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Mesh, Triangle
from reference_rt.shapes.meshes.triangle import Triangles
from reference_rt.shapes.shape import TabulationContext


def frame_of(scene: Scene) -> Frame:
    """The frame that suits a scene's counterpart best in float32."""
    sizes, eye = ShapeSizes(scene), np.array(scene.camera.eye)
    return frame_for(np.minimum(sizes.lower, eye), np.maximum(sizes.upper, eye))


def moved(scene: Scene, frame: Frame) -> Scene:
    """The scene in a frame, with the same picture: radiance does not depend on size.  Returns the
    scene itself if the frame is ours."""
    if frame.is_ours:
        return scene
    x, y, z = frame.center
    steps = (Translate(translate=(-x, -y, -z)), Scale(scale=(frame.scale,) * 3))
    shapes = tuple(
        shape.model_copy(update={"transform": (*shape.transform, *steps)}) for shape in scene.shapes
    )
    camera, motion = scene.camera, Motion(partial(_into, frame), tuple, frame.scale, ())
    there = {
        "eye": motion.point(camera.eye),
        "target": motion.point(camera.target),
        "near": camera.near * frame.scale,
        "far": camera.far and camera.far * frame.scale,
        **type_of_camera(camera).scaled(camera, frame.scale),
    }
    return scene.changed(
        camera=camera.model_copy(update=there),
        shapes=shapes,
        lights=tuple(type_of_light(light).moved(light, motion) for light in scene.lights),
        materials={
            name: material.model_copy(update={"scale": material.scale * frame.scale})
            if isinstance(material, Bump)
            else material
            for name, material in scene.materials.items()
        },
        media={
            name: medium.model_copy(update={"scale": medium.scale / frame.scale})
            for name, medium in scene.media.items()
        },
    )


def _into(frame: Frame, p: Any) -> Triple:
    return triple(frame.into(np.array([p], dtype=np.float64))[0])


# ---- cameras that mirror the picture -------------------------------------------------------------


def mirror(reading: Reading, node: Node) -> None:
    """Mirror the shapes and lights of `reading` by MIRROR for the sensor `node`.  Raises
    SceneError."""
    for name, material in reading.materials.items():
        if isinstance(material, NormalMap):
            # Their green is along n x dp/du, which a mirror reverses.
            raise node.error(
                "'to_world' mirrors the picture, which is not supported together with normal maps "
                f"('{name}'); expected a rotation: mirror the picture instead"
            )
    step = {"matrix": np.column_stack([MIRROR, np.zeros(3)]).tolist()}
    motion = Motion(_mirrored, _mirrored, 1.0, (step,))
    lights = [type_of_light(light).moved(light, motion) for light in reading.lights]
    if None in lights:
        raise node.error(
            "'to_world' mirrors the picture, which is not supported together with lights that "
            "project images; expected a rotation: mirror the picture instead"
        )
    reading.lights = lights
    reading.shapes = [with_steps(shape, motion.steps) for shape in reading.shapes]
    reading.note(
        node,
        "'to_world' mirrors the picture, which our cameras do not: the whole scene is mirrored "
        "instead, x being -x",
    )


def _mirrored(p: Any) -> Triple:
    return triple(MIRROR @ p)


# ---- float32 vertices ----------------------------------------------------------------------------
# Mitsuba rounds a vertex to float32, which turns the normal of a small triangle by u |p| over its
# size: in a scan of 100,000 triangles by more than float32's bound of a ray, and glass before it
# amplifies that. The scene that is compared therefore has meshes with these vertices, as Mitsuba
# holds them, on both sides.


SHARE = 0.01
"""Largest distance by which a vertex moves, over the shortest edge's usual length (the median over
the triangles): beyond it the mesh would be another one, and the comparison is to show Mitsuba's
precision.  The same hundredth as `geometry.frame.SHARE`."""


def with_float32_vertices(scene: Scene) -> tuple[Scene, float, Callable[[], Scene]]:
    """The scene with the meshes and triangles that stand in it by themselves, not in groups or
    solids, moved to the nearest float32 vertices of the counterpart's frame; the largest distance
    by which a vertex moves, 0 if the scene is as it was; and what makes the same of the second
    reader's vertices, for Mitsuba.

    A mesh stays as it is where float32 is too coarse for it (SHARE), and where it cannot be used,
    for the error that `build_tables` raises.
    """
    if not any(isinstance(shape, Mesh | Triangle) for shape in scene.shapes):
        return scene, 0.0, lambda: scene
    frame, largest = frame_of(scene), 0.0
    shapes, changed = list(scene.shapes), {}
    for k, shape in enumerate(scene.shapes):
        if not isinstance(shape, Mesh | Triangle):
            continue
        warned: list[str] = []

        def warn(owner: int, message: str, warned: list[str] = warned) -> None:
            warned.append(message)

        try:
            table = shape.tabulate(TabulationContext(folder=scene.folder, warn=warn))
        except ValueError:
            continue
        rounded, moved = _rounded(_by_corners(table), shape, frame)
        if 0.0 < moved <= SHARE * _edge(table):
            shapes[k], changed[k], largest = rounded, table, max(largest, moved)
            for message in warned:
                scene.warn(message, "shapes", k)
    if not changed:
        return scene, 0.0, lambda: scene
    found = scene.changed(shapes=tuple(shapes))

    def theirs() -> Scene:
        same = True
        for k, table in changed.items():
            shape = scene.shapes[k]
            assert isinstance(shape, Mesh | Triangle)
            second = soup_of(shape, scene.folder).at_corners()
            if not second.is_like(_by_corners(table)):
                shapes[k], same = _rounded(second, shape, frame)[0], False
        return found if same else scene.changed(shapes=tuple(shapes))

    return found, largest, theirs


def _by_corners(table: Triangles) -> Soup:
    normals, uvs, colours, more = (
        None if column is None else column.reshape(3 * len(table.face), -1)
        for column in (table.normals, table.uvs, table.colours, table.more_uvs)
    )
    at_corners = table.vertices.reshape(-1, 3), normals, uvs, colours
    return Soup(*at_corners, numbers=table.face.astype(np.int64), more_uvs=more)


def _rounded(soup: Soup, shape: Mesh | Triangle, frame: Frame) -> tuple[Mesh, float]:
    """Triangles of a shape, by corners, as a mesh with rounded vertices, and how far a vertex
    moves."""
    corners, numbers = soup.positions, soup.numbers
    assert numbers is not None
    vertices = frame.rounded(corners)
    moved = float(np.linalg.norm(vertices - corners, axis=1).max())
    # Faces that are left out, as they have no area, are left out again: numbers stay.
    faces = np.zeros((int(numbers.max()) + 1, 3), np.int64)
    faces[numbers] = np.arange(len(corners)).reshape(-1, 3)
    mesh = Mesh(
        material=shape.material,
        interior=shape.interior,
        exterior=shape.exterior,
        vertices=vertices,
        faces=faces,
        normals=soup.normals,
        uv=soup.uvs,
        more_uv=soup.more_uvs,
        colours=soup.colours,
    )
    return mesh, moved


def _edge(table: Triangles) -> float:
    """The median over triangles of the shortest edge."""
    corners = table.vertices.reshape(-1, 3, 3)
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    return float(np.median(edges.min(axis=1)))

"""A scene as float32 can hold it: in its counterpart's frame, every length scaled and every
radiance unchanged; and with float32 vertices."""

from collections.abc import Callable
from functools import singledispatch
from typing import Any

import numpy as np

from comparisons.cameras.translate import focus_of
from comparisons.geometry.frame import Frame, frame_for
from comparisons.referee.sizes import ShapeSizes
from comparisons.shapes.mesh import soup_of
from comparisons.shapes.soup import Soup
from reference_rt.cameras import Orthographic, Perspective, Pinhole, ThinLens
from reference_rt.cameras.camera import Camera
from reference_rt.core.transform import Scale, Translate
from reference_rt.lights import Point, Projector, Spot
from reference_rt.materials import Bump
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
    camera = scene.camera
    there = {"eye": _point(camera.eye, frame), "target": _point(camera.target, frame)}
    return scene.changed(
        camera=camera.model_copy(
            update=there | planes_of(camera, frame.scale) | lengths_of(camera, frame.scale)
        ),
        shapes=shapes,
        lights=tuple(_light(light, frame) for light in scene.lights),
        materials={
            name: material.model_copy(update={"scale": material.scale * frame.scale})
            if isinstance(material, Bump)
            else material
            for name, material in scene.materials.items()
        },
    )


def _point(p: Any, frame: Frame) -> tuple[float, ...]:
    return tuple(frame.into(np.array([p], dtype=np.float64))[0].tolist())


def planes_of(camera: Camera, scale: float) -> dict[str, Any]:
    """A camera's clipping planes, scaled."""
    return {"near": camera.near * scale, "far": camera.far and camera.far * scale}


@singledispatch
def lengths_of(camera: Any, scale: float) -> dict[str, Any]:
    """A camera's lengths, scaled, except those of which only the ratio matters."""
    raise TypeError(f"lengths_of does not support a {type(camera).__name__}")


@lengths_of.register(Perspective)
@lengths_of.register(Pinhole)
def _(camera: Perspective | Pinhole, scale: float) -> dict[str, Any]:
    return {}


@lengths_of.register
def _(camera: Orthographic, scale: float) -> dict[str, Any]:
    if camera.view is not None:
        return {"view": tuple(scale * x for x in camera.view)}
    return {"width": scale * (2.0 if camera.width is None else camera.width)}


@lengths_of.register
def _(camera: ThinLens, scale: float) -> dict[str, Any]:
    return {
        "aperture_radius": scale * camera.aperture_radius,
        "focus_distance": scale * focus_of(camera),
    }


def _light(light: Any, frame: Frame) -> Any:
    """A light, moved; intensity grows with scale², as irradiance falls with distance²."""
    if isinstance(light, Projector):
        places = {"origin": _point(light.origin, frame), "target": _point(light.target, frame)}
        return light.model_copy(update={"scale": light.scale * frame.scale**2, **places})
    if not isinstance(light, Point | Spot):
        return light
    brighter = tuple(x * frame.scale**2 for x in light.intensity)
    if isinstance(light, Point):
        places = {"position": _point(light.position, frame)}
    else:
        places = {"origin": _point(light.origin, frame), "target": _point(light.target, frame)}
    return light.model_copy(update={"intensity": brighter, **places})


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
        rounded, moved = _rounded(_by_corners(table), shape.material, frame)
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
                shapes[k], same = _rounded(second, shape.material, frame)[0], False
        return found if same else scene.changed(shapes=tuple(shapes))

    return found, largest, theirs


def _by_corners(table: Triangles) -> Soup:
    normals, uvs, colours = (
        None if column is None else column.reshape(3 * len(table.face), -1)
        for column in (table.normals, table.uvs, table.colours)
    )
    numbers = table.face.astype(np.int64)
    return Soup(table.vertices.reshape(-1, 3), normals, uvs, colours, numbers=numbers)


def _rounded(soup: Soup, material: str | None, frame: Frame) -> tuple[Mesh, float]:
    """Triangles, by corners, as a mesh with rounded vertices, and how far a vertex moves."""
    corners, numbers = soup.positions, soup.numbers
    assert numbers is not None
    vertices = frame.rounded(corners)
    moved = float(np.linalg.norm(vertices - corners, axis=1).max())
    # Faces that are left out, as they have no area, are left out again: numbers stay.
    faces = np.zeros((int(numbers.max()) + 1, 3), np.int64)
    faces[numbers] = np.arange(len(corners)).reshape(-1, 3)
    mesh = Mesh(
        material=material,
        vertices=vertices,
        faces=faces,
        normals=soup.normals,
        uv=soup.uvs,
        colours=soup.colours,
    )
    return mesh, moved


def _edge(table: Triangles) -> float:
    """The median over triangles of the shortest edge."""
    corners = table.vertices.reshape(-1, 3, 3)
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    return float(np.median(edges.min(axis=1)))

"""A scene in its counterpart's frame: every length scaled, every radiance unchanged."""

from functools import singledispatch
from typing import Any

import numpy as np

from comparisons.geometry.frame import Frame, frame_for
from comparisons.geometry.sizes import ShapeSizes
from reference_rt.cameras import Orthographic, Perspective, Pinhole, ThinLens
from reference_rt.cameras.camera import Camera
from reference_rt.core.transform import Scale, Translate
from reference_rt.lights import Point, Projector, Spot
from reference_rt.materials import Bump
from reference_rt.rendering.scene import Scene


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
        "focus_distance": scale * camera.focus,
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

"""Parallel rays: Mitsuba's `orthographic`, and its `radiancemeter`, of one ray."""

import numpy as np

from comparisons.cameras.camera import (
    CameraType,
    Data,
    Edges,
    no_lens,
    placed,
    read_place,
    read_planes,
)
from comparisons.cameras.central import centred
from comparisons.cameras.film import Frame
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.node import Node, Reading, triple
from reference_rt.cameras import Orthographic
from reference_rt.cameras.film import Film


def _width(camera: Orthographic) -> float:
    return 2.0 if camera.width is None else camera.width


def _edges(camera: Orthographic, film: Film) -> Edges:
    return centred(_width(camera) / 2.0, film) if camera.view is None else camera.view


def _to_mitsuba(camera: Orthographic, film: Film, context: TranslationContext) -> Data:
    l, r, b, t = _edges(camera, film)
    # Mitsuba's picture is 2 wide and 2 height / width high in the sensor's coordinates.
    right, up = (r - l) / 2.0, (t - b) / 2.0 * (film.width / film.height)
    if context.files is not None and camera.view is None:
        up = right  # to the last bit, so that the reader finds a width
    middle = (l + r) / 2.0, (b + t) / 2.0
    return {"type": "orthographic", **placed(camera, context, right, up, middle)}


def _from_mitsuba(reading: Reading, node: Node, frame: Frame) -> Orthographic:
    place, m = read_place(reading, node, rigid=False)
    place |= read_planes(node)[0]
    node.ignore("focus_distance")
    right, up, _ = np.linalg.norm(m[:, :3], axis=0).tolist()
    look, scale = node.looks()
    if look is not None:
        right, up = map(abs, scale[:2])
    if not frame.is_cropped and right == up:
        return Orthographic(**place, width=2.0 * right)
    l, r, b, t = frame.window(1.0)
    return Orthographic(**place, view=(l * right, r * right, b * up, t * up))


POINT = 1e-12
"""The width of what a camera of parallel rays sees, in place of one ray."""


def _radiance_meter(reading: Reading, node: Node, frame: Frame) -> Orthographic:
    """One ray: a camera of parallel rays that sees next to nothing."""
    given = [key for key in ("origin", "direction") if node.has(key)]
    if node.has("to_world") or not given:
        node.ignore("origin", "direction")  # the map comes before them
        m = node.transform()
        eye, towards = m[:, 3], m[:, 2]
    elif len(given) == 1:
        raise node.error(f"has '{given[0]}' alone; expected 'origin' and 'direction'")
    else:
        eye = np.array(node.vector("origin", (0.0, 0.0, 0.0)))
        towards = np.array(node.vector("direction", (1.0, 0.0, 0.0)))
    if (frame.crop_width, frame.crop_height) != (1, 1):
        raise node.error(
            f"has a film of {frame.crop_width} x {frame.crop_height} pixels for one ray; expected "
            "1 x 1"
        )
    target = eye + max(1.0, float(np.abs(eye).max())) * towards / np.linalg.norm(towards)
    up = np.eye(3)[np.argmin(np.abs(towards))]
    return Orthographic(eye=triple(eye), target=triple(target), up=triple(up), width=POINT)


def _scaled(camera: Orthographic, scale: float) -> Data:
    if camera.view is not None:
        return {"view": tuple(scale * x for x in camera.view)}
    return {"width": scale * _width(camera)}


ORTHOGRAPHIC = CameraType(
    description=Orthographic,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={"orthographic": _from_mitsuba, "radiancemeter": _radiance_meter},
    edges=_edges,
    lens=no_lens,
    is_parallel=True,
    is_upside_down=False,
    scaled=_scaled,
)

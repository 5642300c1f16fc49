"""Sensors of Mitsuba scenes: camera, film, filter, sampler.

Mitsuba's cameras look along local +z, with +y up and +x to the left."""

import math
from typing import Any, NamedTuple

import numpy as np

from comparisons.mitsuba.node import Node, Reading, triple
from reference_rt.cameras import AnyCamera, Orthographic, Perspective, ThinLens
from reference_rt.cameras.film import (
    AnyFilter,
    BoxFilter,
    CatmullRomFilter,
    Film,
    GaussianFilter,
    LanczosFilter,
    MitchellFilter,
    TentFilter,
)
from reference_rt.core.transform import Affine
from reference_rt.lights import Constant, Directional, EnvironmentMap, Point, Projector, Spot
from reference_rt.materials import NormalMap
from reference_rt.sampling import AnySampler, Grid, Independent, Sobol

# ---- films, reconstruction filters, samplers -----------------------------------------------------


class Frame(NamedTuple):
    """The size in pixels of the whole film, and of the window of it that is rendered."""

    width: int
    height: int
    left: int
    top: int
    crop_width: int
    crop_height: int

    @property
    def is_cropped(self) -> bool:
        return (self.crop_width, self.crop_height) != (self.width, self.height)

    def window(self, half: float, shift: tuple[float, float] = (0.0, 0.0)) -> tuple[float, ...]:
        """The view rectangle [l, r, b, t], where the whole film is 2 `half` wide and its pixels are
        square;  shift: of the whole film, in widths to the right and heights down."""
        tall = half * self.height / self.width
        xs = (self.left, self.left + self.crop_width)
        ys = (self.top + self.crop_height, self.top)
        return (
            *((2.0 * (x / self.width + shift[0]) - 1.0) * half for x in xs),
            *((1.0 - 2.0 * (y / self.height + shift[1])) * tall for y in ys),
        )


def read_film(node: Node | None) -> tuple[Frame, Film]:
    if node is None:
        frame = Frame(768, 576, 0, 0, 768, 576)
        return frame, Film(width=768, height=576, filter=GaussianFilter())
    if node.plugin != "hdrfilm":
        raise node.unsupported("expected hdrfilm")
    # They concern the file that Mitsuba writes, or how it samples.
    node.ignore("file_format", "pixel_format", "component_format", "sample_border", "banner")
    node.ignore("compensate")
    width, height = node.integer("width", 768), node.integer("height", 576)
    frame = Frame(
        width,
        height,
        node.integer("crop_offset_x", 0),
        node.integer("crop_offset_y", 0),
        node.integer("crop_width", width),
        node.integer("crop_height", height),
    )
    inside = (
        min(frame.left, frame.top) >= 0
        and min(frame.crop_width, frame.crop_height) >= 1
        and frame.left + frame.crop_width <= width
        and frame.top + frame.crop_height <= height
    )
    if not inside:
        raise node.error(
            f"its window of {frame.crop_width} x {frame.crop_height} pixels at ({frame.left}, "
            f"{frame.top}) is not inside the film of {width} x {height}; expected one that is"
        )
    with node.checking():
        film = Film(
            width=frame.crop_width,
            height=frame.crop_height,
            filter=_filter(node.only("ReconstructionFilter")),
        )
    node.finish()
    return frame, film


def _filter(node: Node | None) -> AnyFilter:
    if node is None:
        return GaussianFilter()
    with node.checking():
        found = _named_filter(node)
    node.finish()
    return found


def _named_filter(node: Node) -> AnyFilter:
    match node.plugin:
        case "box":
            return BoxFilter()
        case "tent":
            return TentFilter(radius=node.number("radius", 1.0))
        case "gaussian":
            return GaussianFilter(stddev=node.number("stddev", 0.5))
        case "mitchell":
            third = 1.0 / 3.0
            return MitchellFilter(b=node.number("B", third), c=node.number("C", third))
        case "catmullrom":
            return CatmullRomFilter()
        case "lanczos":
            return LanczosFilter(lobes=node.integer("lobes", 3))
    raise node.unsupported("expected one of: box, tent, gaussian, mitchell, catmullrom, lanczos")


_STRATIFIED = ("stratified", "multijitter", "orthogonal", "ldsampler")


def read_sampler(node: Node | None) -> AnySampler:
    """Which points are taken does not change the expected picture: ours are the Sobol' points, or
    independent ones."""
    if node is None:
        return Independent(spp=4)
    if node.plugin not in ("independent", *_STRATIFIED):
        raise node.unsupported(f"expected one of: {', '.join(('independent', *_STRATIFIED))}")
    jitters = node.flag("jitter", True)
    node.ignore("strength")
    with node.checking():
        kind = Independent if node.plugin == "independent" else Sobol
        spp, seed = node.integer("sample_count", 4), node.integer("seed", 0)
        sampler: AnySampler = kind(spp=spp, seed=seed)
        if node.plugin == "stratified" and not jitters and math.isqrt(spp) ** 2 == spp > 0:
            sampler = Grid(spp=spp)
    node.finish()
    return sampler


# ---- cameras that mirror the picture -------------------------------------------------------------
# Ours do not: the whole scene is mirrored instead. The picture of a scene by a camera M (a map from
# its own coordinates to the world's) is that of the mirrored scene by the camera W M, for any
# mirroring map W; and W M mirrors no more. Our shapes stay what they are under a map that mirrors:
# their front stays the front, and their uv stay.


MIRROR = np.diag([-1.0, 1.0, 1.0])
"""W: x becomes -x."""

_STEP = {"matrix": np.column_stack([MIRROR, np.zeros(3)]).tolist()}


def mirror_scene(reading: Reading, node: Node) -> None:
    """Mirror the shapes and lights of `reading` for the sensor `node`.  Raises SceneError."""
    for name, material in reading.materials.items():
        if isinstance(material, NormalMap):
            # Their green is along n x dp/du, which a mirror reverses.
            raise node.error(
                "'to_world' mirrors the picture, which is not supported together with normal maps "
                f"('{name}'); expected a rotation: mirror the picture instead"
            )
    if any(isinstance(x, Projector) or getattr(x, "texture", None) for x in reading.lights):
        raise node.error(
            "'to_world' mirrors the picture, which is not supported together with lights that "
            "project images; expected a rotation: mirror the picture instead"
        )
    reading.shapes = [_moved(shape) for shape in reading.shapes]
    reading.lights = [_light(light) for light in reading.lights]
    reading.note(
        node,
        "'to_world' mirrors the picture, which our cameras do not: the whole scene is mirrored "
        "instead, x being -x",
    )


def _moved(part: Any) -> Any:
    """A shape or an environment map under one more step."""
    steps = tuple(step.model_dump() for step in part.transform)
    fields = {name: getattr(part, name) for name in part.model_fields_set}
    return type(part)(**fields | {"transform": (*steps, _STEP)})


def _light(light: Any) -> Any:
    match light:
        case Point():
            return _with(light, "position")
        case Spot():
            return _with(light, "origin", "target")
        case Directional():
            return _with(light, "direction")
        case EnvironmentMap():
            return _moved(light)
        case Constant():
            return light
    raise TypeError(f"no mirror image of {type(light).__name__}")


def _with(light: Any, *vectors: str) -> Any:
    """A light with mirrored vectors."""
    update = {name: tuple((MIRROR @ getattr(light, name)).tolist()) for name in vectors}
    return light.model_copy(update=update)


# ---- sensors -------------------------------------------------------------------------------------


TOLERANCE = 1e-5
"""Of a rotation."""

NEAR, FAR = 1e-9, 1e9
"""Clipping planes that cut nothing."""

CLIP = {"near_clip": 1e-2, "far_clip": 1e4}
"""Mitsuba's defaults."""


_NO_CAMERAS = {
    "distant": "its rays start on a disk around the whole scene, or at a target from there; ",
    "irradiancemeter": "it measures on a surface, not an image; ",
}


class View(NamedTuple):
    """What a sensor says: `sampler` is never None."""

    camera: AnyCamera
    film: Film
    sampler: AnySampler


def read_sensor(reading: Reading, node: Node | None) -> View:
    """A sensor with its film and sampler; without one, Mitsuba's default."""
    if node is None:
        frame, film = Frame(768, 576, 0, 0, 768, 576), Film(width=768, height=576)
        film = film.model_copy(update={"filter": GaussianFilter()})
        return View(_camera_without_element(frame), film, Independent(spp=4))
    if node.plugin not in _CAMERAS:
        why = _NO_CAMERAS.get(node.plugin, "")
        raise node.unsupported(f"{why}expected one of: {', '.join(sorted(_CAMERAS))}")
    for medium in node.children("Medium"):
        raise medium.unsupported("expected a scene without media")
    # The shutter has no effect: nothing moves.
    node.ignore("shutter_open", "shutter_close")
    frame, film = read_film(node.only("Film"))
    sampler = read_sampler(node.only("Sampler"))
    with node.checking():
        camera = _CAMERAS[node.plugin](reading, node, frame)
    node.finish()
    return View(camera, film, sampler)


def _camera_without_element(frame: Frame) -> AnyCamera:
    return Perspective(
        eye=(0, 0, 0),
        target=(0, 0, 1),
        **_focal(50.0),
        near=CLIP["near_clip"],
        far=CLIP["far_clip"],
    )


# ---- cameras ------------------------------------------------------------------------------------


def _place(reading: Reading, node: Node, rigid: bool = True) -> tuple[dict[str, Any], Affine]:
    """eye, target and up, and to_world.  rigid: refuse scales, as Mitsuba does."""
    m = node.transform()
    linear = m[:, :3]
    lengths = np.linalg.norm(linear, axis=0)
    if not lengths.min() > 0.0:
        raise node.error("'to_world' flattens space; expected one that can be undone")
    if rigid and np.abs(lengths - 1.0).max() > 1e-3:
        raise node.error("'to_world' scales, which Mitsuba refuses, too; expected none")
    unit = linear / lengths
    if np.abs(unit.T @ unit - np.eye(3)).max() > TOLERANCE:
        raise node.error("'to_world' shears; expected a rotation and a translation")
    if np.linalg.det(unit) < 0.0:
        mirror_scene(reading, node)
        m, unit = MIRROR @ m, MIRROR @ unit
    elif (look := node.looks()[0]) is not None:
        return {"eye": look.origin, "target": look.target, "up": look.up}, m
    eye = m[:, 3]
    # A target far away in units of the eye's coordinates: the direction must not be lost.
    distance = max(1.0, float(np.abs(eye).max()))
    return {"eye": eye, "target": eye + distance * unit[:, 2], "up": unit[:, 1]}, m


def _planes(node: Node) -> tuple[dict[str, float], float]:
    """near and far, without those that cut nothing; and Mitsuba's far plane."""
    near, far = (node.number(key, default) for key, default in CLIP.items())
    if not 0.0 < near < far:
        raise node.error(
            f"near_clip is {near:g} and far_clip {far:g}; expected near_clip above 0 and below "
            "far_clip"
        )
    found = {"near": near} if near > NEAR else {}
    return found | ({"far": far} if far < FAR else {}), far


_AXES = ("x", "y", "diagonal", "smaller", "larger")


def angle(node: Node, frame: Frame) -> tuple[dict[str, Any], float]:
    """fov and fov_axis, and the tangent of half of the angle across the film's width."""
    if node.has("fov"):
        if node.has("focal_length"):
            raise node.error("has both 'fov' and 'focal_length'; expected one of them")
        fov, axis = node.number("fov", 45.0), node.choice("fov_axis", "x", _AXES)
        if not 0.0 < fov < 180.0:
            raise node.error(f"'fov' is {fov:g}; expected degrees above 0 and below 180")
        values: dict[str, Any] = {"fov": fov, "fov_axis": axis}
    else:
        node.ignore("fov_axis")  # a focal length is that of a film's diagonal
        text = node.take("focal_length")
        try:
            length = float(str("50mm" if text is None else text).removesuffix("mm"))
        except ValueError:
            raise node.error(f"'focal_length' is '{text}'; expected such as 50mm") from None
        if not length > 0.0:
            raise node.error(f"'focal_length' is '{text}'; expected more than 0")
        values = _focal(length)
    spanned = {
        "x": frame.width,
        "y": frame.height,
        "diagonal": math.hypot(frame.width, frame.height),
        "smaller": min(frame.width, frame.height),
        "larger": max(frame.width, frame.height),
    }[values["fov_axis"]]
    return values, math.tan(math.radians(values["fov"]) / 2.0) * frame.width / spanned


def _focal(length: float) -> dict[str, Any]:
    """The angle of a focal length in millimetres, of film of 36 x 24 mm."""
    diagonal = math.hypot(36.0, 24.0)
    return {
        "fov": math.degrees(2.0 * math.atan(diagonal / (2.0 * length))),
        "fov_axis": "diagonal",
    }


def _perspective(reading: Reading, node: Node, frame: Frame) -> AnyCamera:
    place, _ = _place(reading, node)
    place |= _planes(node)[0]
    node.ignore("focus_distance")  # Mitsuba reads it for every projective camera
    values, half = angle(node, frame)
    shift = tuple(node.number(f"principal_point_offset_{axis}", 0.0) for axis in "xy")
    if frame.is_cropped or any(shift):
        values = {"view": frame.window(half, shift)}  # type: ignore[arg-type]
    return Perspective(**place, **values)


def _thin_lens(reading: Reading, node: Node, frame: Frame) -> AnyCamera:
    place, _ = _place(reading, node)
    planes, far = _planes(node)
    place |= planes
    values, half = angle(node, frame)
    if frame.is_cropped:
        values = {"view": frame.window(half)}
    if not node.has("aperture_radius"):
        raise node.error("has no 'aperture_radius'; expected one")
    radius, focus = node.number("aperture_radius", 0.0), node.number("focus_distance", far)
    if radius == 0.0:  # Mitsuba takes a tiny one
        return Perspective(**place, **values)
    return ThinLens(**place, **values, aperture_radius=radius, focus_distance=focus)


def _orthographic(reading: Reading, node: Node, frame: Frame) -> AnyCamera:
    place, m = _place(reading, node, rigid=False)
    place |= _planes(node)[0]
    node.ignore("focus_distance")
    right, up, _ = np.linalg.norm(m[:, :3], axis=0).tolist()
    look, scale = node.looks()
    if look is not None:
        right, up = map(abs, scale[:2])
    if not frame.is_cropped and right == up:
        return Orthographic(**place, width=2.0 * right)
    l, r, b, t = frame.window(1.0)
    return Orthographic(**place, view=(l * right, r * right, b * up, t * up))


def _view_rectangle(reading: Reading, node: Node, frame: Frame) -> AnyCamera:
    """Of our plugin, in files that we have written."""
    place, _ = _place(reading, node)
    place |= _planes(node)[0]
    l, r, b, t = (node.number(name, 0.0) for name in ("left", "right", "bottom", "top"))
    radius, focus = node.number("aperture_radius", 0.0), node.number("focus_distance", 1.0)
    if radius == 0.0:
        return Perspective(**place, view=(l, r, b, t))
    return ThinLens(**place, view=(l, r, b, t), aperture_radius=radius, focus_distance=focus)


POINT = 1e-12
"""The width of what a camera of parallel rays sees, in place of one ray."""


def _radiance_meter(reading: Reading, node: Node, frame: Frame) -> AnyCamera:
    """One ray: a camera of parallel rays that sees next to nothing."""
    if node.has("origin") or node.has("direction"):
        eye = np.array(node.vector("origin", (0.0, 0.0, 0.0)))
        towards = np.array(node.vector("direction", (1.0, 0.0, 0.0)))
        node.ignore("to_world")
    else:
        m = node.transform()
        eye, towards = m[:, 3], m[:, 2]
    if (frame.crop_width, frame.crop_height) != (1, 1):
        raise node.error(
            f"has a film of {frame.crop_width} x {frame.crop_height} pixels for one ray; expected "
            "1 x 1"
        )
    target = eye + max(1.0, float(np.abs(eye).max())) * towards / np.linalg.norm(towards)
    up = np.eye(3)[np.argmin(np.abs(towards))]
    return Orthographic(eye=triple(eye), target=triple(target), up=triple(up), width=POINT)


_CAMERAS = {
    "perspective": _perspective,
    "thinlens": _thin_lens,
    "orthographic": _orthographic,
    "radiancemeter": _radiance_meter,
    "view_rectangle": _view_rectangle,
}

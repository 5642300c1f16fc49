"""What the comparison knows of a type of lights: `LightType`, one per type, in the type's file."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from comparisons.mitsuba.colours import Rgb, colour
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.node import Node, Reading, Triple, triple
from comparisons.mitsuba.parse import LookAt
from comparisons.mitsuba.plugin_table import PluginTable
from comparisons.renderers.vocabulary import GltfWriter, Params, PbrtWriter
from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Description

L = TypeVar("L", bound=Description)

Data = dict[str, Any]
"""Of a plugin of Mitsuba's, or of a light for Cycles."""


class Motion(NamedTuple):
    """A map of the world that keeps angles: of a counterpart's frame, or a mirror.

    point, direction: its maps;  scale: the factor of lengths;  steps: those that it adds to a
    transform of directions alone, none if they stay."""

    point: Callable[[Any], Triple]
    direction: Callable[[Any], Triple]
    scale: float
    steps: tuple[Data, ...]

    @property
    def mirrors(self) -> bool:
        return bool(self.steps)


DOWN = np.array([0.0, 0.0, -1.0])


class Punctual(NamedTuple):
    """A light of glTF's.  data: what its kind has besides colour and intensity;  power: intensity
    or irradiance;  axis: the way in which it shines, unit."""

    power: Rgb
    place: Triple = (0.0, 0.0, 0.0)
    axis: FloatArray = DOWN
    data: Data | None = None


@dataclass(frozen=True, kw_only=True)
class LightType(Generic[L]):
    """A type of lights that are no shapes.  None stands where a type has none.

    A test holds that `LIGHTS` has a row for each member of our `AnyLight`.
    """

    description: type[L]
    table: PluginTable | None
    """Of Mitsuba's plugin, as far as a table can say it."""
    to_mitsuba: Callable[[L, TranslationContext], Data] | None
    """The dictionary of an emitter, of a scene file's if the context has files.  None: a parameter
    of our own integrator.  Raises UntranslatableError, ValueError for a file that cannot be used.
    """
    from_mitsuba: Mapping[str, Callable[[Reading, Node], L]]
    """By Mitsuba's plugin: the light of an element.  Raises SceneError."""
    to_cycles: Callable[[L], Data] | None
    """Blender's light; "BACKGROUND" for the radiance of all directions."""
    to_gltf: Callable[[L, str, GltfWriter], Punctual | None] | None
    """Of a light with this name, with notes; it returns None for what is left out.  Raises
    UnwritableError."""
    to_pbrt: Callable[[L, PbrtWriter], tuple[str, Params] | None] | None
    """pbrt's plugin and its parameters; it returns None for what is left out.  Raises
    UnwritableError."""
    to_povray: Callable[[L], str] | None
    """A light whose colour is its irradiance over pi; empty for what is said elsewhere."""
    moved: Callable[[L, Motion], L | None]
    """The light of a moved world that lights it as before; None if ours cannot have it."""
    at: Callable[[L], Triple] | None
    """The place of a light without extent."""
    along: Callable[[L], Triple] | None
    """The direction in which parallel light travels."""
    surrounds: bool
    """Whether rays that hit nothing see it."""
    is_bounded: bool
    """Whether some directions are dark: no shadow then explains that only one renderer is."""
    projects: Callable[[L], bool]
    """Whether an image or a table makes its intensity vary with the direction."""
    brightest: Callable[[L], float]
    """The largest radiance, irradiance or intensity, where an image counts as 1."""
    float32: Callable[[L, FloatArray], FloatArray] | None
    """(n,): the relative error, at most 1, of Mitsuba's intensity towards points (n, 3), beyond
    that of a few rounded products."""

    @property
    def has_no_extent(self) -> bool:
        """Whether it arrives from one direction alone, which Mitsuba's emitter itself gives."""
        return self.at is not None or self.along is not None

    def towards(self, light: L, p: FloatArray) -> FloatArray:
        """(n, 3): from points (n, 3) towards a light without extent, of any length."""
        if self.at is not None:
            return np.asarray(np.array(self.at(light)) - p)
        assert self.along is not None
        return np.broadcast_to(-np.array(self.along(light)), p.shape)


def shows_no_image(light: Any) -> bool:
    """For `projects`."""
    return False


def brightest_of(name: str) -> Callable[[Any], float]:
    """For `brightest`, of the field with this name."""
    return lambda light: float(np.max(getattr(light, name)))


def brighter(colour: Rgb, motion: Motion) -> Rgb:
    """An intensity in a moved world: irradiance falls with the distance squared."""
    r, g, b = (x * motion.scale**2 for x in colour)
    return r, g, b


def across(axis: FloatArray) -> FloatArray:
    """The axis of the coordinates that is farthest from being parallel to a direction."""
    return np.asarray(np.eye(3)[int(np.argmin(np.abs(axis)))])


def with_steps(part: Any, steps: tuple[Data, ...]) -> Any:
    """A part of a scene with more steps in its transform."""
    own = tuple(step.model_dump() for step in part.transform)
    fields = {name: getattr(part, name) for name in part.model_fields_set}
    return type(part)(**fields | {"transform": (*own, *steps)})


# ---- reading -------------------------------------------------------------------------------------


TOLERANCE = 1e-5
"""Of a rotation, relative."""


def plain(node: Node, key: str) -> Rgb:
    """A colour that is no texture."""
    return colour(node, key, 1.0, "emission")


def by_column(node: Node, key: str, column: int) -> dict[str, Triple]:
    """The column of to_world that says the same as this parameter, where that is not given.  Raises
    SceneError for both."""
    if not node.has(key):
        return {key: triple(node.transform()[:, column])}
    if node.has("to_world"):
        raise node.error(f"has both '{key}' and 'to_world'; expected one of them")
    return {}


def look_of(node: Node) -> tuple[LookAt | None, float]:
    """The <lookat> of to_world, and how far the scale before it stretches y; None and 1 for any
    other transform, and for a scale that turns or mirrors."""
    look, scale = node.looks()
    return (look, scale[1]) if look is not None and min(scale) > 0.0 else (None, 1.0)


def check_size(node: Node, axis: FloatArray) -> None:
    """Raise SceneError for a scale that Mitsuba's lights do not divide out."""
    size = float(np.linalg.norm(axis))
    if abs(size - 1.0) > TOLERANCE:
        raise node.error(
            f"'to_world' scales by {size:g}, which distorts Mitsuba's picture: it takes the vector "
            "for one of length 1; expected a rotation and a translation"
        )


def check_upright(node: Node, rotation: FloatArray) -> None:
    """Raise SceneError for a map that mirrors the image."""
    if np.linalg.det(rotation) < 0.0:
        raise node.error(
            "'to_world' mirrors the image, which is not supported; expected a rotation"
        )


def similarity(node: Node, linear: FloatArray) -> FloatArray:
    """The orthogonal map of a similarity.  Raises SceneError for another map."""
    gram = linear.T @ linear
    size = float(np.trace(gram)) / 3.0
    if not size > 0.0 or np.abs(gram - size * np.eye(3)).max() > TOLERANCE * size:
        raise node.error("'to_world' shears or scales unevenly; expected a rotation")
    if np.array_equal(linear, np.eye(3)):
        return linear
    u, _, v = np.linalg.svd(linear)
    return np.asarray(u @ v)

"""What a type of textures or materials says of itself to other renderers: the words of Cycles,
glTF, pbrt and POV-Ray, and what the writer of a scene does for it.

A type's file knows these alone; the writers, which know all types, are `comparisons.cycles`,
`comparisons.gltf`, `comparisons.pbrt` and `comparisons.povray`.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np

from comparisons.renderers import NoCounterpartError
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.scene import Scene

T = TypeVar("T")

# ---- Cycles --------------------------------------------------------------------------------------

Data = dict[str, Any]
"""What Cycles' worker reads: numbers, lists, names of files beside it."""


class CyclesWriter(Protocol):
    """Its methods raise NoCounterpartError."""

    scene: Scene

    def colour(self, value: Any) -> Any:
        """A colour, or the texture of this name."""

    def number(self, value: Any) -> Any:
        """A number, or the texture of this name."""

    def shader(self, name: str | None) -> Data:
        """The shader of the material with this name."""

    def save(self, array: FloatArray) -> str:
        """The name of a new file that holds an array."""


BLACK: Data = {"type": "black"}


def front(shader: Data) -> Data:
    """A shader that is black from behind."""
    return {"type": "sides", "front": shader, "back": BLACK}


def plain_rgb(value: Any) -> list[float]:
    """A colour or a number as three numbers."""
    return [float(x) for x in np.broadcast_to(value, 3)]


def only(material: Any, **values: Any) -> None:
    """Raise NoCounterpartError for a material whose fields have other values."""
    for name, expected in values.items():
        if not np.all(np.asarray(getattr(material, name)) == expected):
            raise NoCounterpartError(
                f"the material {material.type} with another {name} than {expected}"
            )


# ---- glTF ----------------------------------------------------------------------------------------


@dataclass
class Look:
    """A material in glTF's terms.  Colours and numbers are constants or names of textures.

    tint: a factor of `base`;  of_alpha: whether `roughness` is GGX's alpha, its square;  normals:
    a `normal_map`."""

    base: Any = (0.5, 0.5, 0.5)
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    metallic: Any = 0.0
    roughness: Any = 1.0
    of_alpha: bool = False
    opacity: Any = 1.0
    radiance: Any = (0.0, 0.0, 0.0)
    normals: Any = None
    both_sides: bool = False
    extensions: dict[str, dict[str, Any]] = field(default_factory=dict)


MATTE = {"KHR_materials_specular": {"specularFactor": 0.0}}
"""Without its highlight glTF's dielectric is exactly Lambert's law."""


def matte(colour: Any) -> Look:
    """A surface of Lambert's law."""
    return Look(colour, extensions=dict(MATTE))


def of_index(ior: float) -> dict[str, dict[str, Any]]:
    """The extension of an index of refraction; one below 1 reflects as its inverse, head-on."""
    ior = 1.0 / ior if 0.0 < ior < 1.0 else ior
    return {} if ior == 1.5 else {"KHR_materials_ior": {"ior": ior}}


class GltfUv(NamedTuple):
    """Texture coordinates: matrix (3, 3), of a shape's own, or of a mesh's set `uv_set`."""

    matrix: FloatArray
    uv_set: int = 0

    def is_like(self, other: "GltfUv") -> bool:
        return self.uv_set == other.uv_set and np.array_equal(self.matrix, other.matrix)


class GltfImage(NamedTuple):
    """Linear texels (height, width, 3);  scale: a factor of 8-bit codes in them;  uv: where they
    are;  sampler: glTF's."""

    texels: FloatArray
    scale: float
    uv: GltfUv
    sampler: dict[str, int]


LINEAR, NEAREST = 9729, 9728
WRAPS = {"repeat": 10497, "clamp": 33071, "mirror": 33648}


class GltfWriter(Protocol):
    """Its methods raise UnwritableError."""

    scene: Scene

    def note(self, text: str) -> None:
        """Keep a note for the reader."""

    def look(self, name: str | None) -> Look:
        """The material with this name."""

    def read(self, make: Callable[[], T], *path: str | int) -> T:
        """What `make` reads for the part of the scene at this key path."""


# ---- pbrt ----------------------------------------------------------------------------------------

Params = dict[str, Any]
"""By type and name, such as "rgb L": a bool, a number, a string, or several of them."""

BLACK_PARAMS: Params = {"string type": "diffuse", "rgb reflectance": (0.0, 0.0, 0.0)}

ALONG = ("float uroughness", "float vroughness")
"""The parameters of a material that is anisotropic."""


class PbrtWriter(Protocol):
    """Its methods raise UnwritableError."""

    scene: Scene

    def note(self, text: str) -> None:
        """Keep a note for the reader."""

    def read(self, make: Callable[[], T], *path: str | int) -> T:
        """What `make` reads for the part of the scene at this key path."""

    def material(self, name: str | None, both_sides: bool = False) -> str:
        """The name in the file of the material with this name."""

    def define(self, params: Params, *part: str) -> str:
        """Write a material; its name."""

    def black(self) -> str:
        """The name of a black material."""

    def parameter(self, kind: str, key: str, value: Any) -> Params:
        """A parameter that is a value or the name of a texture.  kind: "rgb" or "float"."""

    def image(self, stem: str, texels: FloatArray) -> str:
        """The name of an image file of linear values (h, w, 3)."""


# ---- POV-Ray -------------------------------------------------------------------------------------


def pov_vector(value: Any) -> str:
    """Numbers as POV-Ray writes them, to the last bit."""
    return "<" + ",".join(repr(float(x)) for x in value) + ">"


@dataclass(frozen=True)
class PovLook:
    """A material in POV-Ray's terms, which multiplies `colour` with what is diffuse and ambient.

    colour (3,), or the name of a texture;  diffuse: factor of the cosine, where a light has its
    irradiance over pi;  ambient (3,): factor of colour and ambient light, also from behind;
    highlight: POV-Ray's word, strength and exponent;  mirror (3,): of the mirrored direction;
    index: of glass, which has none of the others;  both_sides: else black from behind.
    """

    colour: Any = (0.0, 0.0, 0.0)
    diffuse: float = 0.0
    ambient: tuple[float, ...] = (0.0, 0.0, 0.0)
    highlight: tuple[str, float, float] | None = None
    mirror: tuple[float, ...] = (0.0, 0.0, 0.0)
    index: float | None = None
    both_sides: bool = False

    @property
    def is_mirror(self) -> bool:
        """Whether it scatters into the mirrored direction alone."""
        dull = self.highlight is None and self.index is None
        return self.diffuse == 0.0 and not any(self.ambient) and dull

    def weighted(self, weight: float) -> "PovLook":
        """A share of it in a blend."""
        highlight = self.highlight
        if highlight is not None:
            highlight = (highlight[0], weight * highlight[1], highlight[2])
        return replace(
            self,
            diffuse=weight * self.diffuse,
            ambient=tuple(weight * x for x in self.ambient),
            highlight=highlight,
            mirror=tuple(weight * x for x in self.mirror),
        )


class PovWriter(Protocol):
    """Its methods raise NoCounterpartError."""

    scene: Scene

    def look(self, name: str | None) -> PovLook:
        """The material with this name."""

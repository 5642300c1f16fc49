"""Materials made of other materials: mask, two-sided, blend."""

from typing import Any, ClassVar, Literal

from reference_rt.core.model import Examples
from reference_rt.materials.material import Material
from reference_rt.textures import Palette, UnitParameter


class Wrapper(Material):
    """A material made of others, which it names; `reference_rt.materials.nested.flattened` flattens
    it."""

    bases: ClassVar[tuple[str, ...]] = ("base",)
    """The fields that name materials."""

    def tabulate(self, palette: Palette) -> Any:
        raise TypeError("a wrapper has no row of its own: its leaves have")


class Mask(Wrapper):
    """A material with holes: the share 1 - opacity of the light passes straight on.

    Shadow rays take it for opaque, as they do glass.  So light of points and spots does not pass;
    light of surfaces and environments does, by scattered rays.
    """

    EXAMPLES: ClassVar[Examples] = (
        {"base": "base"},
        {"base": "base", "opacity": 0.3},
        {"base": "base", "opacity": "texture"},
    )
    type: Literal["mask"] = "mask"
    base: str
    """Name of the material where the mask is opaque."""
    opacity: UnitParameter = 0.5
    """The fraction of light that meets `base`: from 0 (not there) to 1, or a texture's luminance.
    """


class TwoSided(Wrapper):
    """A material for both sides: `base` in front, `back` behind."""

    EXAMPLES: ClassVar[Examples] = ({"base": "base"}, {"base": "base", "back": "other"})
    bases: ClassVar[tuple[str, ...]] = ("base", "back")
    type: Literal["two_sided"] = "two_sided"
    base: str
    """Name of the material of the front, which the normal points to."""
    back: str | None = None
    """Name of the material of the back.  Default: `base`."""


class Blend(Wrapper):
    """A mixture of two materials: (1 - weight) first + weight second."""

    EXAMPLES: ClassVar[Examples] = (
        {"first": "base", "second": "other"},
        {"first": "other", "second": "base", "weight": 0.3},
        {"first": "base", "second": "base", "weight": "texture"},
    )
    bases: ClassVar[tuple[str, ...]] = ("first", "second")
    type: Literal["blend"] = "blend"
    first: str
    """Name of the material of weight 1 - `weight`."""
    second: str
    """Name of the material of weight `weight`."""
    weight: UnitParameter = 0.5
    """The share of `second`: from 0 to 1, or a texture's luminance."""

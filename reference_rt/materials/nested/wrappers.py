"""Materials made of other materials: mask, two-sided, blend."""

from typing import Any, ClassVar, Literal

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
    """Lets the share 1 - opacity of the light pass straight on.

    Shadow rays take it for opaque, as they do glass: light of points and of spots does not pass,
    that of surfaces and environments is found by scattered rays.
    """

    type: Literal["mask"] = "mask"
    base: str
    opacity: UnitParameter = 0.5


class TwoSided(Wrapper):
    """Scatters on both sides: like `base` in front; behind like `back`, or like `base` too."""

    bases: ClassVar[tuple[str, ...]] = ("base", "back")
    type: Literal["two_sided"] = "two_sided"
    base: str
    back: str | None = None


class Blend(Wrapper):
    """(1 - weight) first + weight second."""

    bases: ClassVar[tuple[str, ...]] = ("first", "second")
    type: Literal["blend"] = "blend"
    first: str
    second: str
    weight: UnitParameter = 0.5

"""Ambient light: I_a of Whitted's integrator, the same everywhere and from no direction."""

from typing import Literal

from reference_rt.core.model import Colour, Description


class Ambient(Description):
    """The textbook's ambient light: a `phong` material adds k_a I_a under `whitted`.  No other
    material or integrator uses it."""

    type: Literal["ambient"] = "ambient"
    radiance: Colour
    """The ambient radiance I_a: W sr^-1 m^-2, linear sRGB."""

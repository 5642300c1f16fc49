"""Ambient light: I_a of Whitted's integrator, the same everywhere and from no direction."""

from typing import Literal

from reference_rt.core.model import Colour, Description


class Ambient(Description):
    """What `phong` materials add as k_a I_a under recursive ray tracing; nothing else sees it."""

    type: Literal["ambient"] = "ambient"
    radiance: Colour
    """W sr^-1 m^-2, linear sRGB."""

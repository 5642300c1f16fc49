"""How much work one comparison may be: samples, replicates, rays, and the bias it must see."""

from typing import Annotated

from pydantic import Field

from reference_rt.core.model import Description

PixelSize = tuple[Annotated[int, Field(ge=1)], Annotated[int, Field(ge=1)]]


class Budget(Description):
    """The work that one comparison of a scene is worth, and what it must be able to see."""

    spp: Annotated[int, Field(ge=1)] | None = None
    """Samples per pixel of each replicate;  none: the scene's own."""
    reference_spp: Annotated[int, Field(ge=1)] | None = None
    """The same of Mitsuba's replicates alone;  none: as many as ours.  Its samples are cheaper and,
    being independent, noisier: the noise of the difference is least for more of them."""
    size: Annotated[PixelSize, Field(strict=False)] | None = None
    """Width and height in pixels;  none: the scene's own."""
    replicates: Annotated[int, Field(ge=2)] = 16
    """Independent renderings on each side."""
    pixels: Annotated[int, Field(ge=16)] = 16_700
    """Camera rays of the Whitted rung, and of the geometry rung, which traces six times as many
    rays in all."""
    light_pixels: Annotated[int, Field(ge=16)] = 1024
    """The same of the rung of direct light."""
    limit: Annotated[float, Field(gt=0)] = 0.005
    """The smallest relative bias of the image mean that must be visible."""
    control: bool = False
    """Mitsuba against itself, other variant and other seeds, instead of ours against Mitsuba."""

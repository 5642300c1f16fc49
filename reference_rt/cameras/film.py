"""Film: the picture's size, its reconstruction filter and the layers (AOVs) beside its colour."""

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from reference_rt.cameras.filters import (
    AnyFilter,
    BoxFilter,
    CatmullRomFilter,
    GaussianFilter,
    LanczosFilter,
    MitchellFilter,
    TentFilter,
)
from reference_rt.core.model import Description

LayerName = Literal["albedo", "normal", "position", "depth", "id", "variance"]


def _each_once(value: Any) -> Any:
    if not isinstance(value, list | tuple):
        raise ValueError("expected a list of layers, such as [albedo, normal]")
    for i, name in enumerate(value):
        if name in value[:i]:
            raise ValueError(f"'{name}' is named twice; expected each layer once")
    return tuple(value)


class Film(Description):
    """The picture: its size in pixels, its reconstruction filter and its layers."""

    width: Annotated[int, Field(ge=1, lt=2**31)] = 256
    """Columns of pixels."""
    height: Annotated[int, Field(ge=1, lt=2**31)] = 256
    """Rows of pixels; row 0 is the top of the picture."""
    filter: AnyFilter = BoxFilter()
    """The reconstruction filter: how a sample's weight in a pixel falls with its distance.
    Default: the mean over the pixel's square."""
    layers: Annotated[tuple[LayerName, ...], BeforeValidator(_each_once)] = ()
    """Which layers (AOVs) are written beside the colour.

    Means over camera rays of the first hit, weighted by the filter, 0 for misses, masked holes
    counting as hits: albedo, the material's own colour, normal, the shading normal without bump
    and normal maps, and position, the point in the world.  For the ray through the centres of pixel
    and lens: depth, the distance from the eye, inf for a miss, and id, the shape's index, -1 for a
    miss.  variance: of the pixel's mean, estimated from its samples; for `sobol` and `grid`, whose
    samples are stratified, an upper estimate.  Ray casting writes its own layers instead.
    """


__all__ = [
    "AnyFilter",
    "BoxFilter",
    "CatmullRomFilter",
    "Film",
    "GaussianFilter",
    "LanczosFilter",
    "LayerName",
    "MitchellFilter",
    "TentFilter",
]

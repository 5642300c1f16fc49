"""Films, reconstruction filters and samplers of Mitsuba scenes."""

import math
from typing import NamedTuple

from comparisons.mitsuba.reading.node import Node
from reference_rt.cameras.film import Film
from reference_rt.cameras.filters import (
    AnyFilter,
    BoxFilter,
    CatmullRomFilter,
    GaussianFilter,
    LanczosFilter,
    MitchellFilter,
    TentFilter,
)
from reference_rt.sampling import AnySampler, Grid, Independent, Sobol


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

"""Film and reconstruction filters: Mitsuba's `hdrfilm` and `rfilter`, in both directions."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

from comparisons.mitsuba.context import UntranslatableError
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugin_table import INTEGER, NUMBER, PluginTable, Row
from comparisons.renderers.vocabulary import Params
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
from reference_rt.core.model import Description

F = TypeVar("F", bound=Description)


@dataclass(frozen=True, kw_only=True)
class FilterType(Generic[F]):
    """What the comparison knows of a type of reconstruction filters.  to_pbrt: pbrt's plugin, its
    radius in pixels, and its other parameters."""

    description: type[F]
    table: PluginTable
    to_pbrt: Callable[[F], tuple[str, float, Params]]


_THIRD = 1.0 / 3.0

FILTERS: tuple[FilterType[Any], ...] = (
    FilterType(
        description=BoxFilter, table=PluginTable("box"), to_pbrt=lambda box: ("box", 0.5, {})
    ),
    FilterType(
        description=TentFilter,
        table=PluginTable("tent", (Row("radius", "radius", NUMBER, 1.0),)),
        to_pbrt=lambda tent: ("triangle", tent.radius, {}),
    ),
    FilterType(
        description=GaussianFilter,
        table=PluginTable("gaussian", (Row("stddev", "stddev", NUMBER, 0.5),)),
        to_pbrt=lambda bell: ("gaussian", 4.0 * bell.stddev, {"float sigma": bell.stddev}),
    ),
    FilterType(
        description=MitchellFilter,
        table=PluginTable(
            "mitchell", (Row("b", "B", NUMBER, _THIRD), Row("c", "C", NUMBER, _THIRD))
        ),
        to_pbrt=lambda cubic: ("mitchell", 2.0, {"float B": cubic.b, "float C": cubic.c}),
    ),
    FilterType(
        description=CatmullRomFilter,
        table=PluginTable("catmullrom"),
        to_pbrt=lambda cubic: ("mitchell", 2.0, {"float B": 0.0, "float C": 0.5}),
    ),
    FilterType(
        description=LanczosFilter,
        table=PluginTable("lanczos", (Row("lobes", "lobes", INTEGER, 3),)),
        to_pbrt=lambda sinc: ("sinc", float(sinc.lobes), {"float tau": float(sinc.lobes)}),
    ),
)
"""All types of filters."""

_BY_DESCRIPTION = {one.description: one for one in FILTERS}

_BY_PLUGIN = {one.table.plugin: one for one in FILTERS}


def type_of(film_filter: Any) -> FilterType[Any]:
    """What is known of a filter's type.  Raises UntranslatableError for one not in FILTERS."""
    known = _BY_DESCRIPTION.get(type(film_filter))
    if known is None:
        raise UntranslatableError(film_filter, "filter")
    return known


def translate_film(film: Film) -> dict[str, Any]:
    """A film's dict: float32 pixels, no half floats anywhere."""
    return {
        "type": "hdrfilm",
        "width": film.width,
        "height": film.height,
        "pixel_format": "rgb",
        "component_format": "float32",
        "rfilter": translate_filter(film.filter),
        # Our pixels sample the whole filter, also beyond the picture's edge; without a border
        # Mitsuba's edge pixels would lack the samples outside.
        "sample_border": not isinstance(film.filter, BoxFilter),
    }


def translate_filter(film_filter: Any) -> dict[str, Any]:
    """A reconstruction filter's dict.  Raises UntranslatableError."""
    return type_of(film_filter).table.write(film_filter)


# ---- reading -------------------------------------------------------------------------------------


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


def read_film(reading: Reading, node: Node | None) -> tuple[Frame, Film]:
    """The size of the whole film, and ours.  Raises SceneError."""
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
            filter=_filter(reading, node.only("ReconstructionFilter")),
        )
    node.finish()
    return frame, film


def _filter(reading: Reading, node: Node | None) -> AnyFilter:
    if node is None:
        return GaussianFilter()
    with node.checking():
        if node.plugin not in _BY_PLUGIN:
            raise node.unsupported(f"expected one of: {', '.join(_BY_PLUGIN)}")
        known = _BY_PLUGIN[node.plugin]
        table = known.table
        found: AnyFilter = known.description(**table.read(reading, node))
    node.finish()
    return found

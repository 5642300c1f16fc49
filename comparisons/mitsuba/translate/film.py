"""Film, filters and samplers -> Mitsuba."""

from functools import singledispatch
from typing import Any

from comparisons.mitsuba.translate.errors import UntranslatableError
from reference_rt.cameras import filters
from reference_rt.cameras.film import Film
from reference_rt.sampling import Grid, Independent, Sobol


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
        "sample_border": not isinstance(film.filter, filters.BoxFilter),
    }


@singledispatch
def translate_filter(film_filter: Any) -> dict[str, Any]:
    """A reconstruction filter's dict.  Raises UntranslatableError."""
    raise UntranslatableError(film_filter, "filter")


@translate_filter.register
def _(film_filter: filters.BoxFilter) -> dict[str, Any]:
    return {"type": "box"}


@translate_filter.register
def _(film_filter: filters.TentFilter) -> dict[str, Any]:
    return {"type": "tent", "radius": film_filter.radius}


@translate_filter.register
def _(film_filter: filters.GaussianFilter) -> dict[str, Any]:
    return {"type": "gaussian", "stddev": film_filter.stddev}


@translate_filter.register
def _(film_filter: filters.MitchellFilter) -> dict[str, Any]:
    return {"type": "mitchell", "B": film_filter.b, "C": film_filter.c}


@translate_filter.register
def _(film_filter: filters.CatmullRomFilter) -> dict[str, Any]:
    return {"type": "catmullrom"}


@translate_filter.register
def _(film_filter: filters.LanczosFilter) -> dict[str, Any]:
    return {"type": "lanczos", "lobes": film_filter.lobes}


@singledispatch
def translate_sampler(sampler: Any) -> dict[str, Any]:
    """A sampler's dict.  Raises UntranslatableError."""
    raise UntranslatableError(sampler, "sampler")


@translate_sampler.register(Sobol)
@translate_sampler.register(Independent)
def _(sampler: Sobol | Independent) -> dict[str, Any]:
    """Independent numbers for both: the statistics of a comparison need independent samples."""
    return {"type": "independent", "sample_count": sampler.spp}


@translate_sampler.register
def _(sampler: Grid) -> dict[str, Any]:
    return {"type": "stratified", "jitter": False, "sample_count": sampler.spp}

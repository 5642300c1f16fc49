"""Film, filters and samplers -> Mitsuba."""

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


def translate_filter(film_filter: Any) -> dict[str, Any]:
    """A reconstruction filter's dict.  Raises UntranslatableError."""
    match film_filter:
        case filters.BoxFilter():
            return {"type": "box"}
        case filters.TentFilter(radius=radius):
            return {"type": "tent", "radius": radius}
        case filters.GaussianFilter(stddev=stddev):
            return {"type": "gaussian", "stddev": stddev}
        case filters.MitchellFilter(b=b, c=c):
            return {"type": "mitchell", "B": b, "C": c}
        case filters.CatmullRomFilter():
            return {"type": "catmullrom"}
        case filters.LanczosFilter(lobes=lobes):
            return {"type": "lanczos", "lobes": lobes}
    raise UntranslatableError(film_filter, "filter")


def translate_sampler(sampler: Any) -> dict[str, Any]:
    """A sampler's dict.  Raises UntranslatableError."""
    match sampler:
        case Sobol(spp=spp) | Independent(spp=spp):
            # For both: the statistics of a comparison need independent samples.
            return {"type": "independent", "sample_count": spp}
        case Grid(spp=spp):
            return {"type": "stratified", "jitter": False, "sample_count": spp}
    raise UntranslatableError(sampler, "sampler")

"""The rung below all others: the film's reconstruction filter, as a function.

Pictures are compared with a box filter, whose pixels share no samples; that the filters agree is
seen here, where there is no noise.
"""

from typing import Any

import numpy as np

from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.scene import for_rays
from comparisons.mitsuba.translate.film import translate_filter
from comparisons.results.case import Tier
from reference_rt.cameras.filters import Filter, GaussianFilter

POINTS = 1000
"""At which the two are asked, evenly across the filter and a tenth beyond."""

CELLS = 64 * POINTS
"""Of the midpoint rule for Mitsuba's integral: Lanczos' of 64 lobes has 500 for each."""

TOLERANCE = 1e-5
"""Of the middle's value: float32's few 1e-7, more where cubics' terms cancel."""

GAUSSIAN = 5e-4
"""The same for Gaussians: Mitsuba has a polynomial, 4.2e-4 below exp at the middle
(src/rfilters/gaussian.cpp)."""


def film(ours: Filter, reference: Filter) -> Tier:
    """Compare our filter with Mitsuba's of another, usually the same; both divided by their
    integrals."""
    plugin = mitsuba().load_dict(translate_filter(reference))
    radius = float(plugin.radius())

    def theirs(x: Any) -> Any:
        values = for_rays(lambda at: (plugin.eval(at),), x)[0]
        return np.where(np.abs(x) < radius, values, 0.0)

    step = 2.0 * radius / CELLS
    integral = float(theirs(-radius + step * (np.arange(CELLS) + 0.5)).sum() * step)
    x = 1.1 * radius * (2.0 * (np.arange(POINTS) + 0.5) / POINTS - 1.0)
    values = np.array([ours.value(at) for at in x.tolist()])
    error = float(np.abs(values - theirs(x) / integral).max() / ours.value(0.0))
    bound = GAUSSIAN if isinstance(reference, GaussianFilter) else TOLERANCE
    numbers = {"points": POINTS, "max_error": error, "max_error_over_bound": error / bound}
    told = f"the filters differ by {error:.2g} of their middle at most"
    return Tier("film", "agree" if error <= bound else "differ", told, numbers)

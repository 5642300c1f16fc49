"""The lowest rung: the film's reconstruction filter, compared as a function.

Pictures are compared with a box filter, whose pixels share no samples.  The scene's own filter is
compared here instead, without noise.
"""

from typing import Any

import numpy as np

from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.scene import for_rays
from comparisons.mitsuba.translate.film import translate_filter
from comparisons.results.case import RungResult
from reference_rt.cameras.filters import Filter, GaussianFilter

POINTS = 1000
"""Points at which both are evaluated, evenly across the filter and a tenth beyond."""

CELLS = 64 * POINTS
"""Cells of the midpoint rule for the integral of Mitsuba's filter: 500 per lobe of a Lanczos filter
of 64 lobes."""

TOLERANCE = 1e-5
"""Largest error, as a fraction of the peak: float32 makes a few 1e-7, more where the terms of cubic
filters cancel."""

GAUSSIAN = 5e-4
"""The same for Gaussians: Mitsuba has a polynomial, 4.2e-4 below exp at the peak
(src/rfilters/gaussian.cpp)."""


def film(ours: Filter, reference: Filter) -> RungResult:
    """Compare our filter with Mitsuba's version of `reference`, usually the same filter; both are
    normalised by their integrals."""
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
    text = f"the filters differ by at most {error:.2g} of their peak"
    return RungResult("film", "agree" if error <= bound else "differ", text, numbers)

"""The lowest rung: the film's reconstruction filter, as a function, by the points that are drawn
from it, and by the picture of a grating.

Pictures are compared with a box filter, whose pixels share no samples.  The scene's own filter is
compared here instead."""

from typing import Any

import numpy as np

from comparisons.cameras.film import translate_filter
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.scene import for_rays
from comparisons.results.case import RungResult
from comparisons.rungs.grating import grating_error
from reference_rt.cameras.film import Filter, GaussianFilter, film_offset
from reference_rt.core.arrays import FloatArray

POINTS = 1000
"""Points at which both are evaluated, evenly across the filter and a tenth beyond."""

CELLS = 64 * POINTS
"""Cells of the midpoint rule for the integral of Mitsuba's filter: 500 per lobe of a Lanczos filter
of 64 lobes."""

TOLERANCE = 1e-5
"""Largest error, as a fraction of the peak: float32 makes a few 1e-7, more where the terms of cubic
filters cancel."""

DRAWN = 1e-3
"""Largest error of the integral up to a point of the filter, by the points that we draw: their
coarseness makes some 1.5 / DRAWS, the polynomial of Mitsuba's Gaussian 0.2e-3."""

DRAWS = 8 * POINTS
"""Points that are drawn, evenly, for it."""

GAUSSIAN = 5e-4
"""The same for Gaussians: Mitsuba has a polynomial, 4.2e-4 below exp at the peak
(src/rfilters/gaussian.cpp)."""


SHARE = 2.0
"""Error of a grating that an error of the filter's values may make, in units of it: its stripes are
narrower than its gaps, and a filter's integral is 1."""


def film(ours: Filter, reference: Filter) -> RungResult:
    """Compare our filter with Mitsuba's version of `reference`, usually the same filter; both are
    normalised by their integrals.  Renders a small picture of its own."""
    plugin = mitsuba().load_dict(translate_filter(reference))
    radius = float(plugin.radius())

    def theirs(x: Any) -> Any:
        values = for_rays(lambda at: (plugin.eval(at),), x)[0]
        return np.where(np.abs(x) < radius, values, 0.0)

    step = 2.0 * radius / CELLS
    middles = theirs(-radius + step * (np.arange(CELLS) + 0.5)) * step
    integral = float(middles.sum())
    x = 1.1 * radius * (2.0 * (np.arange(POINTS) + 0.5) / POINTS - 1.0)
    values = np.array([ours.value(at) for at in x.tolist()])
    error = float(np.abs(values - theirs(x) / integral).max() / ours.value(0.0))
    edges: FloatArray = np.linspace(-radius, radius, CELLS + 1)
    cumulative = np.append(0.0, np.cumsum(middles)) / integral
    drawn = _drawn_error(ours, edges, cumulative)
    bound = GAUSSIAN if isinstance(reference, GaussianFilter) else TOLERANCE
    grating = grating_error(ours, edges, cumulative, bound * SHARE)
    numbers = {
        "points": POINTS,
        "max_error": error,
        "max_error_drawn": drawn,
        "max_error_over_bound": max(error / bound, drawn / DRAWN, grating),
    }
    problems = []
    if not error <= bound:
        problems.append(f"the filters differ by up to {error:.2g} of their peak")
    if not drawn <= DRAWN:
        problems.append(
            f"the points that we draw have {drawn:.2g} more or less of the filter up to some point"
        )
    if not grating <= 1.0:
        problems.append(
            f"a grating through the filter is {grating:.2g} times as far off as noise explains"
        )
    if problems:
        return RungResult("film", "differ", "; ".join(problems), numbers)
    text = (
        f"the filters differ by at most {error:.2g} of their peak; a grating through ours is as "
        "Mitsuba's predicts"
    )
    return RungResult("film", "agree", text, numbers)


def _drawn_error(ours: Filter, edges: FloatArray, integral: FloatArray) -> float:
    """The largest error of the integral up to a point: that of the weights of the points that we
    draw, against `integral` at `edges`."""
    setup = ours.setup()
    drawn = np.array([film_offset(setup, (k + 0.5) / DRAWS) for k in range(DRAWS)])
    order = np.argsort(drawn[:, 0], kind="stable")
    at, weight = drawn[order].T
    # Half of a point's own weight lies before it.
    before = (np.cumsum(weight) - 0.5 * weight) / DRAWS
    return float(np.abs(before - np.interp(at, edges, integral)).max())

"""Reconstruction filters are Mitsuba's, up to their integral, by which Mitsuba divides later."""

import numpy as np
import pytest

import reference_rt as rt
from comparisons.cameras.film import translate_filter
from comparisons.mitsuba.backend import mitsuba
from reference_rt.cameras.film import AnyFilter

FILTERS: tuple[AnyFilter, ...] = (
    rt.BoxFilter(),
    rt.TentFilter(radius=1.5),
    rt.GaussianFilter(),
    rt.GaussianFilter(stddev=0.7),
    rt.MitchellFilter(),
    rt.MitchellFilter(b=0.9, c=0.2),
    rt.CatmullRomFilter(),
    rt.LanczosFilter(),
    rt.LanczosFilter(lobes=2),
    rt.LanczosFilter(lobes=5),
)


@pytest.mark.parametrize("film_filter", FILTERS, ids=str)
def test_values(film_filter: AnyFilter) -> None:
    theirs = mitsuba().load_dict(translate_filter(film_filter))
    radius = theirs.radius()
    # Not at the ends themselves, which are half open.
    x = np.linspace(-1.1, 1.1, 332) * radius
    there = np.array([float(np.array(theirs.eval(float(at))).item()) for at in x])
    ours = np.array([film_filter.value(float(at)) for at in x])
    scale = there.sum() / ours.sum()
    # float32 of cubics whose terms, up to 45, cancel; sines of float32 multiples of pi.  Mitsuba's
    # Gaussian is a polynomial, within 4.2e-4 of the formula (measured) where 1 is its largest.
    tolerance = 5e-4 if isinstance(film_filter, rt.GaussianFilter) else 64 * 2.0**-24
    assert np.abs(there - scale * ours).max() < tolerance
    assert not ours[np.abs(x) > radius * 1.001].any()

"""A grating through the reconstruction filter: shining stripes as fine as three pixels, whose
picture is the filter's integral over them, known from Mitsuba's filter.

It shows that samples fall where the filter has them and that their weights arrive in the colour
and in the layers: with the weights of negative lobes lost, stripes are a third fainter, while
plain areas stay as they are.
"""

import math

import numpy as np

from reference_rt.cameras import Orthographic
from reference_rt.cameras.film import Film, Filter
from reference_rt.core.arrays import FloatArray
from reference_rt.core.transform import Rotate, Scale, Translate, Turn
from reference_rt.integrators import Path
from reference_rt.materials import Emissive
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Independent
from reference_rt.shapes import Rectangle

SIZE = 48
"""Width and height of the picture in pixels."""

PERIOD = 3
"""Width of a stripe and a gap in pixels: a whole number, so that columns repeat."""

STRIPE = (0.2, 1.6)
"""Where a stripe begins and ends in its period."""

SAMPLES = 64

LIMIT = 6.0
"""Largest error in units of the standard error of the mean of a third of the pixels: by chance
2e-9 in each of 18 means."""

ROUNDING = 1e-6
"""Error that is always allowed: what is integrated of Mitsuba's filter has float32 values."""

MARGIN = 96
"""Pixels by which the stripes go on beyond the picture, the radius of the widest filter (64) and
more."""


def grating_error(ours: Filter, edges: FloatArray, integral: FloatArray, slack: float) -> float:
    """The largest error of a mean over LIMIT standard errors: above 1 the filter is not applied
    rightly.

    integral: of the reference's filter, at `edges`;  slack: the error of the reference itself.
    """
    return max(_of_one(ours, edges, integral, slack, turned) for turned in (False, True))


def _of_one(
    ours: Filter, edges: FloatArray, integral: FloatArray, slack: float, turned: bool
) -> float:
    layers = render(_scene(ours, turned)).layers
    worst = 0.0
    expected = _expected(edges, integral)
    for values in (layers["colour"][..., 0], layers["albedo"][..., 1], layers["normal"][..., 2]):
        across = values.T[:, ::-1] if turned else values
        for phase in range(PERIOD):
            pixels = across[:, phase::PERIOD].ravel()
            error = LIMIT * float(pixels.std(ddof=1)) / math.sqrt(pixels.size)
            off = abs(float(pixels.mean()) - expected[phase])
            worst = max(worst, off / (error + slack + ROUNDING))
    return worst if math.isfinite(worst) else math.inf


def _expected(edges: FloatArray, integral: FloatArray) -> list[float]:
    """The value of a pixel of each phase."""
    starts = PERIOD * np.arange(-MARGIN, MARGIN + 1)
    values = []
    for phase in range(PERIOD):
        begin, end = (np.interp(starts + at - phase - 0.5, edges, integral) for at in STRIPE)
        values.append(float(np.sum(end - begin)))
    return values


def _scene(film_filter: Filter, turned: bool) -> Scene:
    """Stripes along y, or along x if `turned`, of radiance 1, one unit a pixel."""
    reach = SIZE / 2 + MARGIN
    first, last = -(MARGIN // PERIOD), (SIZE + MARGIN) // PERIOD
    turn = (Rotate(rotate=Turn(axis=(0, 0, 1), degrees=90)),) if turned else ()
    stripes = []
    for k in range(first, last):
        begin, end = (PERIOD * k + at - SIZE / 2 for at in STRIPE)
        place = (
            Scale(scale=(0.5 * (end - begin), reach, 1.0)),
            Translate(translate=(0.5 * (begin + end), 0.0, 0.0)),
        )
        stripes.append(Rectangle(material="lamp", transform=(*place, *turn)))
    return Scene(
        camera=Orthographic(eye=(0, 0, 1), target=(0, 0, 0), width=SIZE),
        film=Film.model_validate(
            {"width": SIZE, "height": SIZE, "filter": film_filter, "layers": ["albedo", "normal"]}
        ),
        sampler=Independent(spp=SAMPLES),
        integrator=Path(max_depth=1),
        materials={"lamp": Emissive(radiance=(1.0, 1.0, 1.0))},
        shapes=tuple(stripes),
    )

"""Half spaces and slabs: light that is scattered at will between planes, as in an atmosphere.

A sun's irradiance is that of a plane across its rays.  Angles are those of light on its way: mu0 is
the cosine of the sun's, mu of the light that is seen, both to the normal of the planes."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from comparisons.truth.case import Expected, FloatArray, case
from comparisons.truth.film import View, pixel_means
from comparisons.truth.scattering import half_space, half_space_in_sky

SUN = np.array([6.0, 4.0, 2.0])
SKY = np.array([0.5, 1.0, 2.0])


def _register(name: str, text: str, formula: str, tests: str, source: str,
              compute: Callable[[], Expected]) -> None:  # fmt: skip
    """The case of a row of a table."""
    compute.__name__, compute.__doc__ = name, text
    case(formula, tests, source)(compute)


# ---- half spaces --------------------------------------------------------------------------------


def _view(target: tuple[float, float, float], degrees: float) -> View:
    half = float(np.tan(np.radians(degrees / 2.0)))
    return View((0, 0, 1), target, (0, 0, 1), (half, half), (16, 16))


SLANTING, GRAZING = _view((0, 1.2, 0), 50.0), _view((0, 3, 0), 20.0)

HALF_SPACES_IN_SUN = (
    ((0.5, 0.8, 0.95), 1.0, SLANTING),
    ((0.9, 0.99, 0.999), 0.8, SLANTING),
    ((0.3, 0.6, 0.9), 0.6, GRAZING),
    ((0.95, 0.7, 0.98), 0.4, SLANTING),
    ((0.8, 0.4, 0.995), 0.2, SLANTING),
    ((0.2, 0.97, 0.85), 0.1, GRAZING),
)
"""Albedos, the sun's cosine and the view of the cases half_space_sun_1 to _6."""

HALF_SPACES_IN_SKY = (
    ((0.5, 0.8, 0.95), SLANTING),
    ((0.9, 0.99, 0.999), SLANTING),
    ((0.3, 0.6, 0.9), GRAZING),
    ((0.98, 0.7, 0.995), GRAZING),
    ((0.8, 0.4, 0.97), SLANTING),
    ((0.2, 0.95, 0.85), SLANTING),
)
"""Albedos and views of the cases half_space_sky_1 to _6."""


def _half_spaces() -> None:
    for k, (albedo, mu0, view) in enumerate(HALF_SPACES_IN_SUN, 1):

        def in_sun(
            albedo: tuple[float, ...] = albedo, mu0: float = mu0, view: View = view
        ) -> Expected:
            def seen(x: FloatArray, y: FloatArray) -> FloatArray:
                return half_space(np.abs(view.rays(x, y)[..., 2]), albedo, mu0, SUN)

            return Expected(pixel_means(seen, 16, 16), 1e-9)

        first = (
            "A half space scatters light in all directions alike. Its densities differ by colour, "
            "and the result does not depend on them. H obeys Chandrasekhar's integral equation; it "
            "is an elementary integral (Stibbs & Weir 1959)."
        )
        text = first if k == 1 else "As `half_space_sun_1`."
        text += f" Albedos {albedo[0]}, {albedo[1]}, {albedo[2]}; the sun at the cosine {mu0}."
        formula = r"$\frac{a E}{4 \pi} \frac{\mu_0}{\mu + \mu_0} H(\mu) H(\mu_0)$"
        _register(f"half_space_sun_{k}", text, formula, "fog without a bottom in a sun",
                  "Chandrasekhar 1960, 33", in_sun)  # fmt: skip
    for k, (albedo, view) in enumerate(HALF_SPACES_IN_SKY, 1):

        def in_sky(albedo: tuple[float, ...] = albedo, view: View = view) -> Expected:
            def seen(x: FloatArray, y: FloatArray) -> FloatArray:
                return SKY * half_space_in_sky(np.abs(view.rays(x, y)[..., 2]), albedo)

            return Expected(pixel_means(seen, 16, 16), 1e-9)

        first = "The integral of `half_space_sun_1` over all suns is that of the equation of H."
        text = first if k == 1 else "As `half_space_sky_1`."
        text += f" Albedos {albedo[0]}, {albedo[1]}, {albedo[2]}."
        _register(f"half_space_sky_{k}", text, r"$L (1 - \sqrt{1 - a} H(\mu))$",
                  "fog without a bottom in a sky", "Chandrasekhar 1960, 33", in_sky)  # fmt: skip


_half_spaces()

# ---- slabs --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Slab:
    """depth, albedo: optical depths and albedos of red, green and blue;  phase: g of Henyey and
    Greenstein, or weights and g of two of them, or "rayleigh";  sent_back: whether the light is
    seen on the side of its source;  cosine: of the light that is seen;  sun: its cosine, None for a
    sky;  azimuth: between the sun's light and that which is seen, in degrees."""

    depth: tuple[float, float, float]
    albedo: tuple[float, float, float]
    phase: float | tuple[tuple[float, float], ...] | str
    sent_back: bool
    cosine: float
    sun: float | None = None
    azimuth: float = 0.0

    def moments(self, count: int) -> FloatArray:
        """Of the phase function: means of Legendre's polynomials of the cosine."""
        k = np.arange(count)
        if isinstance(self.phase, str):
            return np.where(k == 0, 1.0, np.where(k == 2, 0.1, 0.0))
        lobes = ((1.0, self.phase),) if isinstance(self.phase, float) else self.phase
        return np.asarray(sum(weight * g**k for weight, g in lobes))

    @property
    def words(self) -> str:
        """Of the phase function."""
        if isinstance(self.phase, str):
            return "Rayleigh's phase function"
        if isinstance(self.phase, float):
            return f"g = {self.phase:g}"
        return "a blend of " + " and ".join(f"{weight:g} of g = {g:g}" for weight, g in self.phase)

    @property
    def streams(self) -> int:
        """As many as the peak of the phase function needs in a sun."""
        return 256 if isinstance(self.phase, float) and self.phase > 0.75 else 128


SLABS = {
    "slab_sun_1": Slab((0.2, 1.0, 5.0), (0.9, 0.6, 0.99), 0.0, True, 0.6, 0.7, 60.0),
    "slab_sun_2": Slab((0.5, 2.0, 8.0), (0.7, 0.95, 0.99), -0.5, True, 0.5, 0.8, 120.0),
    "slab_sun_3": Slab((0.1, 1.0, 10.0), (0.99, 0.8, 0.5), 0.3, True, 0.8, 0.4, 30.0),
    "slab_sun_4": Slab((0.5, 1.5, 4.0), (0.95, 0.9, 0.999), 0.5, True, 0.4, 0.6, 180.0),
    "slab_sun_5": Slab((1.0, 3.0, 10.0), (0.99, 0.9, 0.999), 0.7, True, 0.4, 0.5, 20.0),
    "slab_sun_6": Slab((0.3, 1.0, 3.0), (0.99, 0.9, 0.7), 0.9, True, 0.2, 0.2, 0.0),
    "slab_sun_7": Slab((0.3, 1.0, 2.0), (0.9, 0.8, 0.95), -0.3, False, 0.6, 0.8, 90.0),
    "slab_sun_8": Slab((0.2, 1.0, 3.0), (0.9, 0.95, 0.99), 0.5, False, 0.8, 0.7, 20.0),
    "slab_sun_9": Slab((0.5, 2.0, 4.0), (0.99, 0.9, 0.999), 0.8, False, 0.8, 0.9, 10.0),
    "slab_sun_10": Slab((0.3, 1.0, 4.0), (0.9, 0.8, 0.99), 0.9, False, 0.8, 0.75, 5.0),
    "slab_sun_11": Slab((0.1, 0.5, 2.0), (0.999, 0.9, 0.99), "rayleigh", True, 0.5, 0.3, 150.0),
    "slab_sun_12": Slab(
        (0.5, 2.0, 6.0), (0.95, 0.9, 0.99), ((0.7, 0.75), (0.3, -0.4)), True, 0.6, 0.8, 40.0
    ),
    "slab_sky_1": Slab((0.1, 1.0, 10.0), (0.99, 0.7, 0.95), -0.5, True, 0.7),
    "slab_sky_2": Slab((0.5, 2.0, 8.0), (0.9, 0.99, 0.999), 0.5, True, 0.3),
    "slab_sky_3": Slab((1.0, 3.0, 10.0), (0.99, 0.95, 0.999), 0.9, True, 0.2),
    "slab_sky_4": Slab((0.1, 0.7, 3.0), (0.6, 0.9, 0.99), 0.3, False, 0.4),
    "slab_sky_5": Slab((0.5, 2.0, 6.0), (0.9, 0.99, 0.8), 0.7, False, 0.8),
    "slab_sky_6": Slab((1.0, 3.0, 10.0), (0.8, 0.95, 0.999), 0.9, False, 0.6),
}
"""Each colour is a slab of its own."""

RADIANCES = {
    "slab_sun_1": ([0.0232008418, 0.0371074433, 0.165413814], 3.9e-06),
    "slab_sun_2": ([0.0541186659, 0.147143972, 0.203274104], 5.4e-06),
    "slab_sun_3": ([0.00919560258, 0.0361203765, 0.0180804244], 4.4e-05),
    "slab_sun_4": ([0.026050018, 0.0460391418, 0.103745434], 6.2e-07),
    "slab_sun_5": ([0.125669374, 0.116811124, 0.203106035], 2.7e-06),
    "slab_sun_6": ([0.373057455, 0.407532742, 0.21642342], 4.5e-06),
    "slab_sun_7": ([0.0226777513, 0.0377085238, 0.0568690506], 9.0e-07),
    "slab_sun_8": ([0.0726671292, 0.184110931, 0.13171024], 4.3e-06),
    "slab_sun_9": ([0.558886652, 0.583387986, 0.414699564], 1.8e-06),
    "slab_sun_10": ([1.5211207, 2.19730479, 1.06048484], 2.1e-05),
    "slab_sun_11": ([0.0187987458, 0.0489708044, 0.0842609916], 4.2e-05),
    "slab_sun_12": ([0.0260737556, 0.063814178, 0.150077511], 4.0e-06),
    "slab_sky_1": ([0.097318062, 0.282316417, 0.646889608], 1.6e-05),
    "slab_sky_2": ([0.28819793, 0.588272325, 0.82002529], 1.0e-06),
    "slab_sky_3": ([0.351688788, 0.376109725, 0.669622996], 2.3e-07),
    "slab_sky_4": ([0.851471064, 0.518544875, 0.276322068], 8.7e-06),
    "slab_sky_5": ([0.871606958, 0.710426418, 0.0672025985], 9.2e-08),
    "slab_sky_6": ([0.654121777, 0.584739007, 0.513964684], 2.5e-08),
}
"""Of each slab, for a sun of irradiance 1 or a sky of radiance 1, and their relative error at most:
what `python -m comparisons.truth.disort` prints."""


def _slabs() -> None:
    for name, slab in SLABS.items():

        def seen(name: str = name, slab: Slab = slab) -> Expected:
            values, error = RADIANCES[name]
            light = SKY if slab.sun is None else SUN
            return Expected(np.broadcast_to(light * values, (16, 16, 3)).copy(), error)

        first = (
            "The equation of transfer of a plane layer, solved by discrete ordinates with 128 or "
            "256 streams (PythonicDISORT 1.8); half as many tell the error. Each colour is a layer "
            "of its own. "
        )
        text = first if name == "slab_sun_1" else "As `slab_sun_1`. "
        text += (
            f"Optical depths {slab.depth[0]:g}, {slab.depth[1]:g}, {slab.depth[2]:g}; albedos "
            f"{slab.albedo[0]:g}, {slab.albedo[1]:g}, {slab.albedo[2]:g}; seen at the cosine "
            f"{slab.cosine:g}"
        )
        if slab.sun is not None:
            text += f", the sun at {slab.sun:g}, {slab.azimuth:g} degrees beside it"
        side = "sends back" if slab.sent_back else "lets through"
        light = "a sky" if slab.sun is None else "a sun"
        _register(
            name, f"{text}.",
            r"$\mu \frac{dI}{d\tau} = I - a \int p(\Theta) I d\omega$, solved in "
            f"{slab.streams} directions",
            f"what a layer {side} of {light}: {slab.words}", "Stamnes and others 1988", seen,
        )  # fmt: skip


_slabs()

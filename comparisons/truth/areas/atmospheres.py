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
            "Light that is scattered in all directions alike, by a half space whose densities differ "
            "by colour: the result does not depend on them. H obeys Chandrasekhar's integral "
            "equation, and is an elementary integral (Stibbs & Weir 1959)."
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
    def streams(self) -> int:
        """As many as the peak of the phase function needs in a sun."""
        return 256 if isinstance(self.phase, float) and self.phase > 0.75 else 128


SLABS = {
    "slab_sun_1": Slab((0.2, 1.0, 5.0), (0.9, 0.6, 0.99), 0.0, True, 0.6, 0.7, 60.0),
    "slab_sun_2": Slab((0.5, 2.0, 8.0), (0.7, 0.95, 0.99), -0.5, True, 0.5, 0.8, 120.0),
    "slab_sun_3": Slab((0.1, 1.0, 10.0), (0.99, 0.8, 0.5), 0.3, True, 0.8, 0.4, 30.0),
    "slab_sun_4": Slab((0.5, 1.5, 4.0), (0.95, 0.9, 0.999), 0.5, True, 0.4, 0.6, 180.0),
    "slab_sun_5": Slab((1.0, 3.0, 10.0), (0.99, 0.9, 0.999), 0.7, True, 0.7, 0.5, 20.0),
    "slab_sun_6": Slab((1.0, 4.0, 10.0), (0.999, 0.99, 0.9), 0.9, True, 0.5, 0.5, 0.0),
    "slab_sun_7": Slab((0.3, 1.0, 3.0), (0.9, 0.8, 0.99), -0.3, False, 0.6, 0.8, 90.0),
    "slab_sun_8": Slab((0.2, 1.0, 6.0), (0.9, 0.95, 0.99), 0.5, False, 0.8, 0.6, 45.0),
    "slab_sun_9": Slab((0.5, 2.0, 10.0), (0.99, 0.9, 0.999), 0.8, False, 0.7, 0.9, 10.0),
    "slab_sun_10": Slab((0.3, 1.0, 4.0), (0.9, 0.99, 0.999), 0.9, False, 0.9, 0.7, 60.0),
    "slab_sun_11": Slab((0.1, 0.5, 2.0), (0.999, 0.9, 0.99), "rayleigh", True, 0.5, 0.3, 150.0),
    "slab_sun_12": Slab(
        (0.5, 2.0, 6.0), (0.95, 0.9, 0.99), ((0.7, 0.75), (0.3, -0.4)), True, 0.6, 0.8, 40.0
    ),
    "slab_sky_1": Slab((0.1, 1.0, 10.0), (0.99, 0.7, 0.95), -0.5, True, 0.7),
    "slab_sky_2": Slab((0.5, 2.0, 8.0), (0.9, 0.99, 0.999), 0.5, True, 0.3),
    "slab_sky_3": Slab((1.0, 5.0, 10.0), (0.99, 0.95, 0.999), 0.9, True, 0.5),
    "slab_sky_4": Slab((0.1, 0.7, 3.0), (0.6, 0.9, 0.99), 0.3, False, 0.4),
    "slab_sky_5": Slab((0.5, 2.0, 6.0), (0.9, 0.99, 0.8), 0.7, False, 0.8),
    "slab_sky_6": Slab((1.0, 3.0, 10.0), (0.8, 0.95, 0.999), 0.9, False, 0.6),
}
"""Each colour is a slab of its own."""

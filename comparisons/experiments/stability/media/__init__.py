"""F14: media: ways, flights and directions, as thin, thick, narrow and white as they come.

Law, u = 2^-53 (Mitsuba: its own u = 2^-24, and numbers that float32 holds).
- absorption: a layer leaves exp(-sigma_t s) of the light, s the exact way of the very ray between
  the very planes: to 16 u, plus 4 u sigma_t s for the rounding of the exponent, plus what the
  placement of surfaces allows: a ray leaves a plane by the plane's error bound B
  (`reference_rt.core.ray.surface_error`), so that s is off by up to 2 B / cosine;
- flights: the distance that a number n from [0, 1) draws is -ln(1 - n) / sigma_t to 4 u: a
  logarithm (2 u, its library's bound), and a quotient;
- scattering in layers: in a layer of the optical depth tau those numbers scatter that are below
  1 - exp(-tau), and no others, to 16 u of tau;
- phase values: Henyey and Greenstein's function of the very g and cosine, to 16 u: ten roundings,
  each of a factor of the value or of a sum of positive terms;
- turned light: the angle between the light before and after is the one whose distribution function
  is the number drawn, to 16 u: the rounding of two directions and of a frame;
- phase densities: directions have the stated density (chi-square, at the level of
  `harness.chance`);
- half spaces: one that scatters isotropically sends 1 - sqrt(1 - a) H(mu) of an even sky back, H
  Chandrasekhar's function, whatever its density: to the noise of the mean, and to a tenth;
- white media: what scatters all light cannot be seen under an even sky, at any depth, with any
  phase function, and any ratio of the densities of colours: likewise;
- matched indices: a layer that absorbs behind boundaries of matched index is as bright as Fresnel's
  equations and Beer's law say, to the noise; a white ball behind one is invisible in each pixel, to
  64 u for each edge of all paths but few.

Range.  Optical depths 1e-8 to 600 in absorption (float64 ends at exp(-745)), 1e-15 to 25 in
scattering (beyond 36 all numbers scatter), 1e-8 to 100 in white layers, where paths get so long
that their roulette has no variance beyond;  layers as thin as 1e-10 of their coordinates, or 1e-12
of their offset;  |g| to 1 - 1e-8, 0.9999 in pictures;  1 / (1 - albedo) to 1e4, and albedo 1;
indices 1 + 1e-12 to 2.

Counts.  Of a point in the full run: 20,000 rays, flights, layers and directions; 100,000 directions
of a density; pictures of 1024 pixels of 16 samples.

Passes.  No failure.

`ways`: absorption and flights; `turns`: phase functions; `pictures`: rendered media."""

from comparisons.experiments.stability.harness.series import Family
from comparisons.experiments.stability.media import pictures, turns, ways

__all__ = ["pictures", "turns", "ways"]

FAMILY = Family(
    "F14",
    "media",
    "light is absorbed, scattered and turned as Beer's law, Chandrasekhar's H function and phase "
    "functions say, in media of any depth, albedo and asymmetry",
    "Mitsuba: chi-square of phase functions, one g each; pbrt: transmittance of one depth",
)

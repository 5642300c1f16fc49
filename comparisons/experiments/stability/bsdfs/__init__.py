"""F11: reciprocity, sampling and the digits of materials at their extremes.

Law.
- reciprocity: |f(a, b) - f(b, a)| <= 1e-12 of the larger; through a boundary of what
  carries power, f(a, b) eta_b² = f(b, a) eta_a², eta the index on a direction's side.  1e-12 is
  9007 u, u = 2^-53; Mitsuba, in float32, is given 9007 of its own u = 2^-24 (5.4e-4).  Values below
  1e-290 (1e-30) count as 0: they have lost digits to the end of the exponent.
- consistency: the weight that `sample` returns times its density is `evaluate` at the
  direction drawn, and the density is `pdf`, to 32 u times the condition 14 / (|h| min(alpha, cos,
  g)) of a half vector h: what rounding a direction to floats changes D, the cosines and Fresnel's
  root by.
- bounds: everything is finite; no sample of a metal or a glass weighs more than 1 in power.
- densities: samples have the stated density (chi-square, at the level of `harness.chance`), and it
  integrates to at most 1, up to what two rules of quadrature differ by;
- digits: Fresnel's R and T, the distribution D and the masking G1 are the exact
  formulae of the very floats, evaluated in 300 bits, to 64 u of their value, plus what moving the
  cosine by 4 u moves them (as at the critical angle); of Beckmann's D times 1 + slope², as its
  exponent is rounded.  Mitsuba gets the same in its own u, and numbers that float32 holds.

Range.  Cosines to 1e-12, alpha 1e-4 to 1, indices 1 ± 1e-8 to 4, the critical angle to 1e-15 of it.
Mitsuba takes no part where its float32 cannot tell the index from 1.

Counts.  1e5 pairs of directions a material and point in the full run.

Passes.  No failure; each chi-square test has a false alarm of at most 1e-8.

`reciprocity`, `samples` and `values` have the cases; `exact` has the formulae."""

from comparisons.experiments.stability.bsdfs import reciprocity, samples, values
from comparisons.experiments.stability.harness.series import Family

__all__ = ["reciprocity", "samples", "values"]

FAMILY = Family(
    "F11",
    "reciprocity and sampling of materials",
    "light goes either way alike, samples have the density that is said, and the formulae keep "
    "their digits at grazing angles, in narrow lobes and at matched indices",
    "Nori: 15 cases of chi-square; pbrt: its reciprocity test of hair is switched off",
)

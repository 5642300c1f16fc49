"""F12: radiometry at extremes: sizes, distances, brightness, angles, depth.

Law, u = 2^-53 (Mitsuba: its own u = 2^-24, and numbers that float32 holds).
- a point light's I / d² arrives to 8 u, from a direction right to 8 u, at distances 1e-9 to 1e9;
- a spot's falloff, of cones from 20 degrees to 1e-6, is the exact one of the very floats to
  16 u / (cutoff - beam) + 16 u, what rounding a direction turns it by; and to 1e-3 for anyone;
- the solid angle of a sphere, seen from 1 + 1e-12 to 1e6 radii, is the exact one to
  16 u (1 + 1 / cos), cos that of half the cone: at a distance d, 1 - r²/d² rounds by u;
- that of rectangles and triangles, from 1e-20 to 2 pi: the mean of 1 / pdf over the random numbers
  of a sample, by Gauss's rule with 20² nodes, to 64 u times the condition of van Oosterom and
  Strackee's denominator, and what the rule leaves in doubt, up to 1 %;
- lamps of areas 1e-12 to 1e12 light a floor, seen under one angle, as the closed form says, and so
  do lamps of radiance 1e-30 to 1e30: within their noise (`harness.chance`) and to a tenth, finite;
- paths with roulette at every bounce gather (1 - a^n) / (1 - a) in n edges of a closed furnace, n
  to 1e3, within their noise and to a tenth.

Range.  As the law says, law by law.

Counts.  Of a point in the full run: 20,000 receivers for point lights, spots and spheres, 2,000 for
rectangles and for triangles, 400 numbers at each; pictures of 1024 pixels of 16 samples, 64 for
roulette.

Passes.  No failure.

`lamps`: rendered pictures; `points`: point lights and spots; `solid_angles`: densities."""

from comparisons.experiments.stability.harness.series import Family
from comparisons.experiments.stability.radiometry import lamps, points, solid_angles

__all__ = ["lamps", "points", "solid_angles"]

FAMILY = Family(
    "F12",
    "radiometry at extremes",
    "light of any size, distance, brightness, cone and depth arrives as closed forms say",
    "no other project is known to test these",
)

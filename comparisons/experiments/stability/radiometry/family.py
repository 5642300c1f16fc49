"""The series of F12; the folder's docstring states the law."""

from comparisons.experiments.stability.harness.family import Family
from comparisons.experiments.stability.radiometry.flat_lights import FLAT, SKY
from comparisons.experiments.stability.radiometry.lamps import AREA, RADIANCE, ROULETTE
from comparisons.experiments.stability.radiometry.lights import DISTANCE, SPOT
from comparisons.experiments.stability.radiometry.solid_angles import CLOSE_SPHERE, SMALL_SPHERE

FAMILY = Family(
    id="F12",
    name="radiometry at extremes",
    law="light of any size, distance, brightness, cone and depth arrives as closed forms say",
    anchors="no other project is known to test these",
    series=(AREA, RADIANCE, DISTANCE, SPOT, SMALL_SPHERE, CLOSE_SPHERE, FLAT, SKY, ROULETTE),
)

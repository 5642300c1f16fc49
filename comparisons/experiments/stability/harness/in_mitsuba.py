"""Scenes and rays in Mitsuba as they are: not moved to where float32 is most precise."""

from typing import Any

import reference_rt as rt
from comparisons import translator
from comparisons.experiments.stability.harness.outcomes import FloatArray
from comparisons.geometry import frame
from comparisons.mitsuba import counterpart
from comparisons.mitsuba.hits import MitsubaHits
from comparisons.mitsuba.scene import picture


def loaded(scene: rt.Scene) -> Any:
    """Mitsuba's scene, in the variant that is set."""
    return translator.load(scene, frame.OURS).mi_scene


def traced(scene: rt.Scene, o: FloatArray, d: FloatArray) -> MitsubaHits:
    """The closest hits of rays (n, 3) in it."""
    return counterpart.trace(translator.load(scene, frame.OURS), o, d)


def rendered(scene: rt.Scene, spp: int, seed: int) -> FloatArray:
    """(height, width, 3)."""
    return picture(loaded(scene), spp, seed)

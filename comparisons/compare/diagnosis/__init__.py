"""Diagnosis: the likeliest cause of a difference, if one can be recognised.

`of_rungs` recognises causes from the numbers of the deterministic rungs.  `likeliest` fits each
`Hypothesis` (gain, gamma, shift, lost light, ...) to the pictures and returns the one that explains
most of the squared difference beyond noise, if it is clearly better than the others; otherwise the
one place (row, tile, pixels) that holds the difference, or None.  A cause must also reproduce the
bias of each channel's mean, and those of blocks (`Misfit.reproduces`).

To add a hypothesis, yield it from `brightness`, `colour`, `tones` or `place`: the picture that the
candidate would be, and how many parameters were fitted.  One with as many or fewer is its rival,
unless it is of the same family.
"""

from comparisons.compare.diagnosis.colour import A_MATRIX
from comparisons.compare.diagnosis.pictures import likeliest
from comparisons.compare.diagnosis.rungs import of_rungs
from comparisons.compare.diagnosis.tones import A_CURVE

__all__ = ["FLEXIBLE", "likeliest", "of_rungs"]

FLEXIBLE = (A_CURVE, A_MATRIX)
"""Causes with so many parameters that they may fit what has a simpler one."""

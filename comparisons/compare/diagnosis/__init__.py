"""Diagnosis: the likeliest cause of a difference, if one can be recognised.

`of_rungs` recognises causes from the numbers of the deterministic rungs.  `likeliest` fits each
`Hypothesis` (gain, gamma, shift, lost light, ...) to the pictures and returns the one that explains
most of the squared difference beyond noise, if it is clearly better than the others; otherwise the
one place (row, tile, pixels) that holds the difference, or None.

To add a hypothesis, yield it from `brightness.hypotheses` or `place.hypotheses`: the picture that
the candidate would be, and how many parameters were fitted.
"""

from comparisons.compare.diagnosis.of_pictures import likeliest
from comparisons.compare.diagnosis.of_rungs import of_rungs

__all__ = ["likeliest", "of_rungs"]

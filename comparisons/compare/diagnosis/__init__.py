"""Diagnosis: the likeliest cause of a difference, if one can be recognised.

`of_rungs` recognises causes from the numbers of the deterministic rungs.  `likeliest` fits each
`Hypothesis` (gain, gamma, shift, lost light, ...) to the pictures and returns the one that explains
most of the squared difference beyond noise, if it is clearly better than the others and leaves no
more than noise; otherwise two of them together, first of positions and then of colours; otherwise
the one place (row, tile, pixels) that holds the difference; otherwise a simple one that explains
most of it, as a part; or None.  A cause must also reproduce the bias of each channel's mean, and
those of blocks (`Misfit.reproduces`).

A sample of the pixels shows which causes can be: only these are fitted to the whole picture
(`contest`).

To add a hypothesis about colours, yield it from one of the `FITS` of `brightness`, `colour` or
`tones`: the picture that the candidate would be, and how many parameters were fitted.  One with as
many or fewer is its rival, unless it is of the same family.  What happens to positions is a `Move`
of `place`, or a row of `warps.WARPS`.
"""

from comparisons.compare.diagnosis.pictures import IN_PART, Fits, is_sure, likeliest
from comparisons.compare.diagnosis.rungs import of_rungs

__all__ = ["IN_PART", "Fits", "is_sure", "likeliest", "of_rungs"]

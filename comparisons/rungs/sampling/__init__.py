"""The rung of what our own samples say of themselves: lights, materials and Russian roulette.

`lights`: the densities of light samples;  `materials`: those of sampled directions, and their
weights;  `roulette`: that paths which go on carry the light of those that end;  `rung` asks them in
this order.  No second renderer takes part: a wrong density may leave the mean of a picture nearly
as it is, or hide in its noise.
"""

from comparisons.rungs.sampling.rung import sampling

__all__ = ["sampling"]

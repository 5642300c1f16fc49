"""The light sampler: which light a shadow ray is sent to.

`choice.py` picks among all lights: by power if there are few, or else by the light tree for lights
that have bounds and by power for the rest, which are infinitely far away.  `bounds.py` has the
boxes, cones of normals and intensities of lights.

Contract: `pick(choice, tree, p, n, u)` takes a point and the unit normal there on the side that
light may come from, n = 0 for both sides, and a number u from [0, 1).  It returns a light's number
and the probability of picking it; probability 0 means that no light reaches `p`.  `probability` is
the same number for a given light, to the last bit.  Every light that reaches `p` has a probability
above 0: bounds may only be too large.

To add a light to the tree: a function in `bounds.py` that returns its `LightBounds`.
"""

"""Materials made of others: mask, blend, two-sided, bump and normal map, nested to any depth.

When a scene is built, `paths.py` follows every path from such a material to a BSDF leaf and
`flattened.py` stores the leaves of a material one after the other, each with the steps of its path.
At a hit, `prepare` runs the steps: each multiplies the leaf's weight, a number from 0 to 1, or
replaces its frame.  What the material scatters is the sum of its leaves times their weights;
weight 0 means that a leaf has no part here.

To add one: its description (a `Wrapper`) here; a code of its step and a case in `paths.py`; a
branch in `flattened.py`, and a table there if the step has parameters; a member of
the union of all materials.
"""

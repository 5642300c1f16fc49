"""The types of lights, one file each.

A light at a point or with one direction has a description, whose `tabulate()` returns one row of
its table (a NamedTuple of arrays), and

- `sample(table, i, p) -> LightSample`, a kernel: the only direction from `p` to light i, with
  pdf = 1 and is_delta; pdf = 0 means that nothing arrives;
- `power(table, scene_radius) -> (n,)`: luminance of the power into the sphere around the scene, in
  W if the description is in W: the light sampler's weights.

An environment has `radiance(table, d)`, `pdf(table, d)` per solid angle and `sample(table, u0, u1)`
for directions d away from the scene.  `area.py` does the same for emissive primitives of all
shapes.

To add one, see `lights`.
"""

"""F13: surfaces that are close to each other.

Law.  What lies between two surfaces is not skipped: rays that go straight on from surface to
surface meet them in their order, light gets into the gap and no further than it should, and glass
after glass lets through what Fresnel says, as long as the gap is more than

    4 B,  B = 17 sqrt(3) u (2 |c| + 6 s),  u = 2^-53,

c being the middle of the scene (largest coordinate) and s its half width: a ray begins up to B off
what it leaves (F2), on either side of the gap, and its target is seen no more precisely.

Range.  Gaps from 1e-1 to 1e-14 of the scale, about the origin and 1000 scales away.

Counts.  20,000 rays in each point of the full run.

Passes.  No failure up to the last decade of gaps above 4 B: 1e-13 at the origin, 1e-10 far away.
Answers are known in closed form; points of a contact shadow within 4 B of its edge are undecidable.

Mitsuba begins rays (1 + max |p|) RayEpsilon off, RayEpsilon = 8.9e-5 in its float32: gaps below
that are predicted to be skipped, from x = 1.1e4 on at the latest, and far away from x = 11.

`stacks`: the order of surfaces; `light`: the contact shadow, and panes of glass.
"""

"""F9: a scene that is moved, scaled, turned, mirrored, reordered or grouped looks the same.

Law, ids.  Rays moved with the scene hit the same (shape, copy, part, face or triangle).  Where the
transformed numbers are exact - whole-number offsets, factors 2^k, another order - t is the same to
the last bit, up to the factor.  Where they are rounded - factors 10^k, turns, offsets beyond 2^53 -
a ray that differs is a failure unless both answers are right, each in its own scene as it is in
float64, by exact arithmetic (`comparisons.geometry.exact.referee`), for a ray as near as rounding
moves it; of solids, whose crossings count as one where rounding cannot tell them apart, by the law
of F7.  A third of the rays goes anywhere, a third towards edges at 2^-4 to 2^-14 of the way, a
third towards edges down to float64's rounding, which Mitsuba is not asked.

Law, light.  A pixel changes by at most 4 times what it changes by when the eye, or each shape and
light by itself, moves by 64 u (offset + size), with the roundoff u of each contestant, 2^-53 or
2^-24, plus (512 u + 64 u (offset + size) / size) of itself; `light` derives all of these, and the
band of exact arithmetic is derived in `rays`.  Under 2^k, and in another order, pictures are the
same to the last bit.

Range.  Offset / size 1 to 1e13, factors 1e-50 to 1e50 and 2^-160 to 2^160, all mirrors and
exchanges of axes, any rotation, groups nested up to 16 deep.

Counts.  Rays of a point as in `family._CASES`; a picture has 48 x 36 pixels.

Passes.  No failure within each series' guaranteed range.

`motion` transforms scenes, `rearranged` reorders and groups them; `rays`, `solids` and `light`
judge.
"""

"""F4: thin shapes, and rays that graze.

Law.  A hit is one: its t is in the exact hit interval, which is where rays moved by no more than
rounding meet the shape (`judge` has the bound, 144 u (|o| + size)); a miss is exact, or a ray so
moved misses.  A hit may also be up to 1e-3 of the shape off the exact one, which lets float32 pass
where it only rounds.  What float64 may not do, and what Embree was found to do (embree#387:
t = 12291.2 on a triangle at 1), is to report a point where there is no shape.

Range.  Triangles of aspect 1 to 1e12, aligned and turned; boxes of aspect 1 to 1e12; angles of 1e-1
to 1e-15 between rays and triangles, rectangles, disks and faces of boxes.

Counts.  8 shapes a point, quick 2,000 rays, full 40,000.

Passes.  No failure, up to the end of every range.

Every other shape and its rays are rounded to float32, and Mitsuba gets the very same numbers as
ours and the textbook's methods; the others are for these alone.  Mitsuba is judged by the same
law: what its rounding turns into a miss or a hit is wrong.

`drawn` draws shapes and rays; `judge` decides; `shots`: maps of a triangle.
"""

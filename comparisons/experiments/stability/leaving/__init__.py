"""F2: rays that leave a surface do not meet it again, and lose nothing that is near.

Law.  A ray meets a shape at p, with the outward normal n, and goes on from there towards any w.
(1) It does not meet again what it leaves: towards the outer side of a convex shape, and to either
side of a flat one, it meets nothing; whatever else it meets, exact arithmetic on the ray as it
begins, (o', w), meets too, within a factor of 2 in t, so that it is another place.
(2) Nothing is lost: into a closed shape it meets the far wall, through its outer side, and

    |o' - p| <= B = 17 sqrt(3) u (2 |c| + 6 s),  u = 2^-53,

c being the middle of the shape (largest coordinate) and s its longest half axis, however thin.
(3) The first ray, aimed at what is well inside, meets the shape wherever exact arithmetic says so.

Undecidable.  Where the shape is thinner than 4 B within B of p, along the normal or along w, its
walls are one: next to an edge, p may lie beyond the neighbouring face, by its rounding.  Such cases
are left open, and so are first rays whose answer hangs on moving them by B.

Range.  15 kinds of shapes, sizes 1e-8 to 1e8, axes up to 1e12 times as long as others, middles up
to 1e10 sizes from the origin and beyond, directions up to cos = 1e-15 to the surface.

Counts.  In the full run 10^6 departures of each kind in its own series, 1000 shapes by 1000 rays.
Every departure is traced; exact arithmetic decides those that look suspicious, by the sign of w · n
where they meet something again, and a sample of all others.

Passes.  No failure.

Mitsuba leaves by `si.spawn_ray(w)`: an offset of (1 + max |p|) RayEpsilon along the normal, and
RayEpsilon is 8.9e-5 in its float32.  It is judged by the size in place of B: a ray that begins more
than s / 100 off has lost neighbours that are as near, as predicted from |c| = 112 s on, and for
shapes smaller than 8.9e-3.  While it takes part, all numbers of shapes and rays are rounded to
float32 first, for everyone.  The textbook's ray, which begins at o + t d + 1e-4 w, is judged in
the same way.

`shapes` places shapes and aims rays; `tracer` and `mitsuba` trace; `judge` decides; `shots`.
"""

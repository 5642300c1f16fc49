"""F1: far and small quadrics, spheres and tori.

Law.  A ray hits a sphere where the exact discriminant says so, wherever it passes the rim by more
than 5 u of the radius (u = 2^-53; `law.BAND` derives it), at any distance D, offset and size; then
|t - exact| |d| <= 16 u (|t| |d| + D) + 5 u r² / h, h half the chord, the last term being what the
band makes of the root.  Of the other kinds the answer is the exact one of a ray that passes at most
64 u sizes beside (`law.MOVED`), t to within 16 u (|t| |d| + D).  A hit is within this of the
surface, and so within the bounding box.

Range.  Distance / radius 1e0 to 1e12 (each times 2 to 10; of other kinds 1 to 10, so that rays
begin within their boxes too), the centre's offset 1e0 to 1e12 radii, radius 1e-9 to 1e9, |d| 1e-3
to 1e3 times the distance; half of the rays within 2^-1 to 2^-40 radii of tangency, in `rim` to
2^-53.  Spheres, ellipsoids, open cylinders, cones, paraboloids, capped hyperboloids of one sheet,
tori.

Counts.  1e5 rays a decade for spheres, 2e4 for quadrics, 2e3 for tori, whose arbiter takes 100 µs.

Passes.  No ray outside of the bands breaks the law.  The arbiter is exact: integers times powers of
two, for tori FLINT's certified roots.  A band of 1e-10 radii at a distance of 1e6 would be the
first power of ten above u D / r: the law holds with 5 u at every distance.

Mitsuba takes part with its scalar variant's spheres, cylinders and instances of spheres, in numbers
that float32 has, judged by the exact answer for these and by the same law in float32's u = 2^-24;
the other kinds are meshes there.

`law` judges; `spheres` and `curved` draw rays and compute the contestants' answers; `picture`.
"""

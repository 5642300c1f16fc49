"""F8: roots of polynomials: the quartic of tori, the quadratics of quadrics.

Law.  As many real roots as there are, each off by at most 16 u (sum of the terms' sizes) /
|derivative| there, what rounding the coefficients and evaluating makes of it, beside 16 u (|t| |d|
+ D) of a ray's own t.  Undecidable, and left open, are cases with two roots, real or complex, less
than four such bounds apart: rounded coefficients may join or part them.

Range.  Lines 1 to 1e-16 sizes from a double root; from one where three or four roots come together
(along an asymptotic direction of a torus; along its top circle, in that plane); tori 1e0 to 1e12
sizes away; quadratics 1 to 1e-16 of b² from a double root; quadratics whose roots' ratio is 1e0 to
1e16.  Tubes from 0.05 to 0.95 of the ring's radius.

Counts.  1e5 in `double`, 3e4 in `several` and `far`, 1e5 a series of quadratics.

Passes.  No root missed, none too many, none off by more.  FLINT certifies all four complex roots
of quartics in exact integers; the discriminant of quadratics is exact.

Contestants (`solvers`).  Ours is what the renderer has: for tori Newton's steps and halving on the
distance between the quartic's turning points, for quadrics q / a and c / q of q = -(b ± sqrt(D)).
"numpy.roots" is the companion matrix, "ferrari" the closed form, "quadratic.formula" (-b ± sqrt(D))
/ 2 a.  They get the coefficients in floats, of a line that begins next to the torus, but in
`far`, where it begins at the ray's origin.  Mitsuba has no torus and no quartic.  `law` judges.
"""

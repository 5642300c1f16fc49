"""`reference-rt truth`: scenes whose pixels are known by formula, for any renderer.

`areas` holds the formulas, a module for each area; `case` is what a case is, and the registry.  The
scene of a case is the file of its name in `scenes/truth`.  `film` and `optics` are what formulas
share.  Formulas import NumPy and SciPy, and nothing of `reference_rt` or of Mitsuba: a test holds
that.

`judge` compares pictures of any renderer with the formula, `renderers` makes those of ours and of
Mitsuba, `gate` reads other people's, `outputs` writes JSON, the page and the badge.

To add a case, write its scene, and a function with the decorator `case` in the module of its area.
Its docstring is the derivation.  The tests take it from there.
"""

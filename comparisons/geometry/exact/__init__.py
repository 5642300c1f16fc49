"""Exact arithmetic: `dyadic` numbers, and what the `crossings` of rays with shapes are made of.

The numbers of rays and of table rows are floats, that is, exact rationals.  Python's integers,
which never overflow, decide everything, a whole array at a time: about 5 µs a ray; FLINT solves the
quartics of tori, about 100 µs a ray.  Each shape's own crossings stand in its file in
`comparisons/shapes`; `comparisons.referee` finds first hits by them.
"""

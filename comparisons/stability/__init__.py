"""Where renderers fail as scenes become extreme, decided by exact arithmetic and closed forms.

A file a family, `f01_far.py` to `f14_determinism.py`: its law, its ranges, its counts and what
passes stand at the top.  `reference-rt stability` runs them.
"""

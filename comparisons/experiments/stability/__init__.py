"""Where renderers fail as scenes become extreme, decided by exact arithmetic and closed forms.

A file a family, `far/family.py` to `determinism/family.py`: its law, its ranges, its counts and
what passes stand at the top.  `reference-rt stability` runs them.
"""

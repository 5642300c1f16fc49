"""The command line `reference-rt`.

`main.py` holds the program and its commands `render`, `explain` and `schema`; other packages add
commands through the entry-point group `reference_rt.commands`.  `explain.py` writes what a scene
needs, `limits.py` the sizes and distances up to which float64 keeps its digits in it.
"""

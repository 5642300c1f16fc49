"""`reference-rt bench`: the speed of the renderer, each number beside what it is measured against.

One file per group of rows; `groups.py` lists them.  `run.py` measures what is not measured yet,
`table.py` shows it.
"""

"""Where renderers fail as scenes become extreme, decided by exact arithmetic and closed forms.

`reference-rt stability` runs 14 families, F1 to F14, a module or a folder each: its docstring
states the law (what must hold), the range, the counts of cases and what passes; its `FAMILY` has
the law in one sentence.  A family has series: functions `measure(draw, x)` with the decorator
`series`, which return an `Outcome` for each contestant (ours, Mitsuba, textbook methods) at a point
x of a sweep (`Sweep`: from ordinary to extreme).  The docstring says what is drawn and what breaks
the law.  Ours must not fail at any x within the series' guaranteed range (`holds_to`).

To add a family: see `harness/series.py`.  Families do not import each other: what two of them use
lives in `harness`.
"""

"""Where renderers fail as scenes become extreme, decided by exact arithmetic and closed forms.

`reference-rt stability` runs 13 families, F1 to F13, a module or a folder each: its docstring
states the law (what must hold), the range, the counts of cases and what passes; it defines
`FAMILY`.  A family has series; a series is a sweep (`Sweep`: the points x, from ordinary to
extreme) and a `measure(draw, x)` that returns an `Outcome` for each contestant: ours, Mitsuba,
textbook methods. Ours must not fail at any x within the series' guaranteed range (`holds_to`).

To add a family: a module and a line in `harness/core.py`.  Families do not
import each other: what two of them use lives in `harness`.
"""

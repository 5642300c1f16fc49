"""The names of Mitsuba's integrators that differentiate; imported without NumPy, for the options of
commands."""

from typing import Literal

DifferentiatorName = Literal["prb", "prb_basic", "prb_projective", "direct_projective"]
"""Mitsuba's integrators that differentiate; the latter two see edges that move."""

Guiding = Literal["none", "grid", "octree"]
"""How the latter two choose the edges that they sample."""

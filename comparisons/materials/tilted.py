"""What bump and normal maps have in common: what becomes of normals that they tilt too far."""

from comparisons.mitsuba.plugin_table import FLAG, Row

TILT = tuple(
    Row(name, name, FLAG, True) for name in ("flip_invalid_normals", "use_shadowing_function")
)
"""Mitsuba's options, on by default, unlike ours."""

"""Plugins for Mitsuba: materials, lights, views and integrators that it lacks or approximates.

Each module has `register(mi)`, which defines a class and registers it with Mitsuba: the classes
derive from classes of a variant, so this runs after every change of the variant.  Plugins follow
Mitsuba's interface (`sample`, `eval`, `pdf`; local directions, float32) and must work in scalar and
in llvm variants.  BSDFs share the class of `base`.  To add a plugin: a module with `register`, its
name in `register` below, and a `translate_*` function that uses it."""

from typing import Any

from comparisons.mitsuba.plugins import (
    exact_coat,
    exact_coordinates,
    goniometric,
    materials,
    media_of_solids,
    mesh_area,
    path_of_solids,
    view_rectangle,
    whitted,
)


def register(mi: Any) -> None:
    """Register the plugins of this folder for the current variant."""
    plugins = (
        *(exact_coat, exact_coordinates, goniometric, materials),
        *(media_of_solids, mesh_area, path_of_solids, view_rectangle, whitted),
    )
    for plugin in plugins:
        plugin.register(mi)

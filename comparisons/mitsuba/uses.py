"""What our side uses of Mitsuba by name: its plugins, and the numbers of its meshes.

Another version than the one that is required may have renamed one.  Then the first use of Mitsuba
says which, and names both versions (`comparisons.mitsuba.backend.mitsuba`).
"""

import importlib.util
from typing import Any, get_args

from comparisons.results.differentiators import DifferentiatorName

PLUGINS = (
    *("scene", "path", "volpath", "volpathmis", "direct", "ptracer", "aov"),
    *("perspective", "thinlens", "orthographic", "hdrfilm"),
    *("independent", "stratified", "multijitter"),
    *("box", "tent", "gaussian", "mitchell", "catmullrom", "lanczos"),
    *("sphere", "rectangle", "disk", "cylinder", "cube", "shapegroup", "instance"),
    *("area", "constant", "envmap", "point", "spot", "directional", "projector"),
    *("diffuse", "conductor", "roughconductor", "dielectric", "roughdielectric", "thindielectric"),
    *("plastic", "roughplastic", "principled", "principledthin"),
    *("blendbsdf", "mask", "twosided", "bumpmap", "normalmap"),
    *("null", "homogeneous", "isotropic", "hg", "rayleigh", "blendphase"),
    *("bitmap", "checkerboard", "mesh_attribute"),
)
"""Of Mitsuba's own, those that our dictionaries name."""

IN_PYTHON = get_args(DifferentiatorName)
"""Of its plugins that are written in Python, which its manager does not list."""

OF_MESHES = ("vertex_positions", "vertex_normals", "vertex_texcoords", "faces")
"""What `mitsuba.traverse` must list of a mesh."""


def lacking(mi: Any) -> tuple[str, ...]:
    """The names that Mitsuba, its variant set, does not have."""
    manager = mi.PluginManager.instance()
    unknown = mi.ObjectType.Unknown
    plugins = [f"plugin '{name}'" for name in PLUGINS if manager.plugin_type(name) == unknown]
    plugins += [
        f"plugin '{name}'"
        for name in IN_PYTHON
        if importlib.util.find_spec(f"mitsuba.python.ad.integrators.{name}") is None
    ]
    mesh = mi.Mesh("mesh", 3, 1, has_vertex_normals=True, has_vertex_texcoords=True)
    listed = mi.traverse(mesh).keys()
    return (*plugins, *(f"'{name}' of meshes" for name in OF_MESHES if name not in listed))

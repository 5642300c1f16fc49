"""reference_rt: an independent float64 reference ray tracer.

    from reference_rt import Scene, render

    scene = Scene.load("scenes/cornell_box.yaml")
    picture = render(scene, spp=64)  # a Picture: save(path), show(), layers
    hits = scene.intersect(origins, directions)  # for arrays of rays

`help(reference_rt.Sphere)` and its like describe a type; `Sphere.model_fields["radius"]` a field.

- A scene: Scene, Film, json_schema; SceneError, SceneWarning
- Cameras: Perspective, Orthographic, Pinhole, ThinLens
- Shapes: Sphere, Plane, Disk, Rectangle, Triangle, Polygon, Box, Cylinder, Cone, Torus, Quadric,
  Mesh, Instance; solids: Union, Intersection, Difference
- Materials: Diffuse, Mirror, Dielectric, ThinDielectric, Conductor, RoughConductor,
  RoughDielectric, Plastic, RoughPlastic, Principled, PrincipledThin, Phong, Emissive; made of
  others: Mask, TwoSided, Blend, Bump, NormalMap
- Textures: Checker, Bitmap, VertexColours
- Lights: Point, Spot, Projector, Directional, Constant, EnvironmentMap, Ambient
- Integrators: Path, Direct, Whitted, RayCast
- Samplers: Sobol, Independent, Grid
- Filters: BoxFilter, TentFilter, GaussianFilter, MitchellFilter, CatmullRomFilter, LanczosFilter
- Pictures: render, Picture, read_image, ImageError
- Queries: query (array queries, the methods of Scene), transform (affine maps), textbook (the
  textbook's intersection methods), build_tables, SceneTables
- Other errors: ReferenceRtError, ReferenceUnavailableError, UsageError

Other modules are internal.  A name is imported when it is first used: importing the package takes
milliseconds, and the renderer, with Numba, a second.  Folders from the lowest to the highest, each
of which may import those before it: util, jit, core, sampling, textures, shapes, cameras, accel,
materials, lights, integrators, scene, rendering, textbook, cli.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from reference_rt import query, textbook, transform
    from reference_rt.cameras import Orthographic, Perspective, Pinhole, ThinLens
    from reference_rt.cameras.film import (
        BoxFilter,
        CatmullRomFilter,
        Film,
        GaussianFilter,
        LanczosFilter,
        MitchellFilter,
        TentFilter,
    )
    from reference_rt.integrators import Direct, Path, RayCast, Whitted
    from reference_rt.integrators.scene_tables import SceneTables
    from reference_rt.lights import (
        Ambient,
        Constant,
        Directional,
        EnvironmentMap,
        Point,
        Projector,
        Spot,
    )
    from reference_rt.materials import (
        Blend,
        Bump,
        Conductor,
        Dielectric,
        Diffuse,
        Emissive,
        Mask,
        Mirror,
        NormalMap,
        Phong,
        Plastic,
        Principled,
        PrincipledThin,
        RoughConductor,
        RoughDielectric,
        RoughPlastic,
        ThinDielectric,
        TwoSided,
    )
    from reference_rt.rendering.image import read_image
    from reference_rt.rendering.picture import Picture
    from reference_rt.rendering.render import render
    from reference_rt.rendering.scene import Scene
    from reference_rt.sampling import Grid, Independent, Sobol
    from reference_rt.scene.build import build_tables
    from reference_rt.scene.model import json_schema
    from reference_rt.shapes import (
        Box,
        Cone,
        Cylinder,
        Disk,
        Mesh,
        Plane,
        Polygon,
        Quadric,
        Rectangle,
        Sphere,
        Torus,
        Triangle,
    )
    from reference_rt.shapes.csg import Difference, Intersection, Union
    from reference_rt.shapes.instances import Instance
    from reference_rt.textures import Bitmap, Checker, VertexColours
    from reference_rt.util.errors import (
        ImageError,
        ReferenceRtError,
        ReferenceUnavailableError,
        SceneError,
        SceneWarning,
        UsageError,
    )

    __all__ = [
        "Ambient",
        "Bitmap",
        "Blend",
        "Box",
        "BoxFilter",
        "Bump",
        "CatmullRomFilter",
        "Checker",
        "Conductor",
        "Cone",
        "Constant",
        "Cylinder",
        "Dielectric",
        "Difference",
        "Diffuse",
        "Direct",
        "Directional",
        "Disk",
        "Emissive",
        "EnvironmentMap",
        "Film",
        "GaussianFilter",
        "Grid",
        "ImageError",
        "Independent",
        "Instance",
        "Intersection",
        "LanczosFilter",
        "Mask",
        "Mesh",
        "Mirror",
        "MitchellFilter",
        "NormalMap",
        "Orthographic",
        "Path",
        "Perspective",
        "Phong",
        "Picture",
        "Pinhole",
        "Plane",
        "Plastic",
        "Point",
        "Polygon",
        "Principled",
        "PrincipledThin",
        "Projector",
        "Quadric",
        "RayCast",
        "Rectangle",
        "ReferenceRtError",
        "ReferenceUnavailableError",
        "RoughConductor",
        "RoughDielectric",
        "RoughPlastic",
        "Scene",
        "SceneError",
        "SceneTables",
        "SceneWarning",
        "Sobol",
        "Sphere",
        "Spot",
        "TentFilter",
        "ThinDielectric",
        "ThinLens",
        "Torus",
        "Triangle",
        "TwoSided",
        "Union",
        "UsageError",
        "VertexColours",
        "Whitted",
        "__version__",
        "build_tables",
        "json_schema",
        "query",
        "read_image",
        "render",
        "textbook",
        "transform",
    ]

_EXPORTS = {
    "reference_rt.cameras": "Orthographic Perspective Pinhole ThinLens",
    "reference_rt.cameras.film": (
        "BoxFilter CatmullRomFilter Film GaussianFilter LanczosFilter MitchellFilter TentFilter"
    ),
    "reference_rt.integrators": "Direct Path RayCast Whitted",
    "reference_rt.integrators.scene_tables": "SceneTables",
    "reference_rt.lights": "Ambient Constant Directional EnvironmentMap Point Projector Spot",
    "reference_rt.materials": (
        "Blend Bump Conductor Dielectric Diffuse Emissive Mask Mirror NormalMap Phong Plastic "
        "Principled PrincipledThin RoughConductor RoughDielectric RoughPlastic ThinDielectric "
        "TwoSided"
    ),
    "reference_rt.rendering.image": "read_image",
    "reference_rt.rendering.picture": "Picture",
    "reference_rt.rendering.render": "render",
    "reference_rt.rendering.scene": "Scene",
    "reference_rt.sampling": "Grid Independent Sobol",
    "reference_rt.scene.build": "build_tables",
    "reference_rt.scene.model": "json_schema",
    "reference_rt.shapes": (
        "Box Cone Cylinder Disk Mesh Plane Polygon Quadric Rectangle Sphere Torus Triangle"
    ),
    "reference_rt.shapes.csg": "Difference Intersection Union",
    "reference_rt.shapes.instances": "Instance",
    "reference_rt.textures": "Bitmap Checker VertexColours",
    "reference_rt.util.errors": (
        "ImageError ReferenceRtError ReferenceUnavailableError SceneError SceneWarning UsageError"
    ),
}
"""The public names of each module; at run time in place of the imports above."""

_MODULES = {name: module for module, names in _EXPORTS.items() for name in names.split()}
_SUBMODULES = ("query", "textbook", "transform")


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    if name == "__version__":  # reading the metadata takes milliseconds
        return str(importlib.import_module("importlib.metadata").version("reference-rt"))
    if name in _SUBMODULES:
        return importlib.import_module(f"reference_rt.{name}")
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The public names, for completion.  There is no `__all__` at run time: `help` would print all
    types with all their methods, 30,000 lines."""
    return sorted({*globals(), *_MODULES, *_SUBMODULES, "__version__"})

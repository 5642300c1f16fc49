"""reference_rt: an independent float64 reference ray tracer.

The public interface: descriptions of scenes (`Scene` and its parts), `render`, `build_tables`,
`json_schema` and the errors, all exported here; `reference_rt.query` (array queries of a scene's
tables), `reference_rt.transform` (affine maps) and `reference_rt.textbook` (textbook intersection
methods).  Other modules are internal.  Folders from the lowest to the highest, each of which may
import those before it: util, jit, core, sampling, textures, shapes, cameras, accel, materials,
lights, integrators, scene, rendering, textbook, cli.
"""

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
    "read_image",
    "render",
]


def __getattr__(name: str) -> str:
    if name == "__version__":  # reading the metadata takes milliseconds
        import importlib.metadata

        return importlib.metadata.version("reference-rt")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

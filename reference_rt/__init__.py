"""reference_rt: an independent float64 reference ray tracer."""

from reference_rt.cameras import Orthographic, Perspective, Pinhole, ThinLens
from reference_rt.csg import Difference, Intersection, Union
from reference_rt.errors import (
    ImageError,
    ReferenceRtError,
    ReferenceUnavailableError,
    SceneError,
    UsageError,
)
from reference_rt.film import BoxFilter, Film, GaussianFilter, TentFilter
from reference_rt.groups import Instance
from reference_rt.integrators import Path, RayCast, Whitted
from reference_rt.lights import Constant, Point
from reference_rt.materials import Dielectric, Diffuse, Emissive, Mirror
from reference_rt.render import Picture, render
from reference_rt.sampling import Grid, Independent, Sobol
from reference_rt.scene import Scene, json_schema
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
from reference_rt.tables import SceneTables, build_tables

__all__ = [
    "Box",
    "BoxFilter",
    "Cone",
    "Constant",
    "Cylinder",
    "Dielectric",
    "Difference",
    "Diffuse",
    "Disk",
    "Emissive",
    "Film",
    "GaussianFilter",
    "Grid",
    "ImageError",
    "Independent",
    "Instance",
    "Intersection",
    "Mesh",
    "Mirror",
    "Orthographic",
    "Path",
    "Perspective",
    "Picture",
    "Pinhole",
    "Plane",
    "Point",
    "Polygon",
    "Quadric",
    "RayCast",
    "Rectangle",
    "ReferenceRtError",
    "ReferenceUnavailableError",
    "Scene",
    "SceneError",
    "SceneTables",
    "Sobol",
    "Sphere",
    "TentFilter",
    "ThinLens",
    "Torus",
    "Triangle",
    "Union",
    "UsageError",
    "Whitted",
    "build_tables",
    "json_schema",
    "render",
]

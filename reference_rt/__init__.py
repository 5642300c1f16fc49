"""reference_rt: an independent float64 reference ray tracer."""

from reference_rt.cameras import Orthographic, Perspective
from reference_rt.errors import (
    ImageError,
    ReferenceRtError,
    ReferenceUnavailableError,
    SceneError,
    UsageError,
)
from reference_rt.film import BoxFilter, Film, GaussianFilter, TentFilter
from reference_rt.integrators import Path, RayCast, Whitted
from reference_rt.lights import Constant, Point
from reference_rt.materials import Dielectric, Diffuse, Emissive, Mirror
from reference_rt.render import Picture, render
from reference_rt.sampling import Grid, Independent, Sobol
from reference_rt.scene import Scene, json_schema
from reference_rt.shapes import Box, Mesh, Rectangle, Sphere, Triangle
from reference_rt.tables import SceneTables, build_tables

__all__ = [
    "Box",
    "BoxFilter",
    "Constant",
    "Dielectric",
    "Diffuse",
    "Emissive",
    "Film",
    "GaussianFilter",
    "Grid",
    "ImageError",
    "Independent",
    "Mesh",
    "Mirror",
    "Orthographic",
    "Path",
    "Perspective",
    "Picture",
    "Point",
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
    "Triangle",
    "UsageError",
    "Whitted",
    "build_tables",
    "json_schema",
    "render",
]

"""The scenes that F9 renders.

All coordinates are multiples of 1/64 below 8 (where shapes are turned: of their centres), so that
whole-number offsets up to 2^46 and factors 2^k move a scene exactly, in float64; in float32 up to
2^15.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.meshes import BALL, write_obj
from comparisons.experiments.stability.harness.steps import at, scaled, turned
from reference_rt.textures.texture import UvMap

if TYPE_CHECKING:
    import trimesh


SIZE = 4.0
"""About the radius of each scene about the origin, its eye included."""

GRID = 64.0

FILM = rt.Film(width=48, height=36)

CAMERA = rt.Perspective(eye=(1, 2, 7), target=(0, 0, 0), fov=48)

FLOOR = (scaled(4.0, 4.0, 1.0), turned(-90.0), at(0.0, -1.0, 0.0))


def ball(subdivisions: int = 2) -> "trimesh.Trimesh":
    """A closed ball of 20 * 4^subdivisions triangles, vertices rounded to multiples of 1/64."""
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    vertices = np.rint(np.asarray(mesh.vertices) * GRID) / GRID
    return trimesh.Trimesh(vertices, mesh.faces, process=False)


def write_ball(folder: Path) -> None:
    """The file that the scenes name, in its place."""
    mesh = ball()
    write_obj(folder / BALL, mesh.vertices, mesh.faces)


def in_folder(folder: Path, **parts: Any) -> rt.Scene:
    """A scene whose files lie in `folder`, where the ball is put."""
    if not (folder / BALL).exists():
        write_ball(folder)
    empty = rt.Scene.parse("{}", folder=folder)
    return empty.changed(camera=CAMERA, film=FILM, **parts)


def things(folder: Path) -> rt.Scene:
    """Shapes that Mitsuba has too: balls, boxes, flat shapes, a mesh, a cylinder, instances."""
    return in_folder(
        folder,
        integrator=rt.RayCast(),
        hierarchy="sah",
        groups={
            "pair": (
                rt.Sphere(radius=0.375, center=(-0.25, 0, 0)),
                rt.Mesh(file=BALL, transform=(scaled(0.25), at(0.25, 0.25, 0))),
            )
        },
        shapes=(
            rt.Rectangle(transform=FLOOR),
            rt.Sphere(center=(-1.5, 0, 0), radius=0.75),
            rt.Sphere(center=(-0.75, 0.5, -1), radius=1.0),
            rt.Box(transform=(scaled(0.5), turned(33.0, (1, 2, 3)), at(1.5, -0.25, 1))),
            rt.Box(transform=(scaled(0.5, 0.75, 0.25), at(2.5, 0, -0.5))),
            rt.Mesh(file=BALL, transform=(scaled(0.75), at(0.5, 0.25, 1.5))),
            rt.Triangle(v0=(-3, -1, -2), v1=(3, -1, -2.5), v2=(0.25, 3, -2.25)),
            rt.Disk(transform=(turned(50.0, (2, 1, 0)), at(-2.5, 1.5, 0.5))),
            rt.Cylinder(radius=0.25, transform=(turned(70.0), at(0.75, 1.25, 0.5))),
            rt.Instance(group="pair", transform=(turned(40.0), at(1.5, 1.5, 0))),
            rt.Instance(group="pair", transform=(scaled(1, 2, 1), at(-2.5, -0.25, 1.5))),
        ),
    )


def curves(folder: Path) -> rt.Scene:
    """Shapes that Mitsuba has not: cones, quadrics, tori, ellipsoids, endless planes, polygons."""
    saddle = (1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    bowl = (1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0)
    star = ((0, 1, 0), (0.625, -0.75, 0), (-1, 0.25, 0), (1, 0.25, 0), (-0.625, -0.75, 0))
    return in_folder(
        folder,
        integrator=rt.RayCast(),
        hierarchy="sah",
        shapes=(
            rt.Plane(transform=(turned(-90.0), at(0.0, -1.0, 0.0))),
            rt.Cone(transform=(turned(-90.0), at(-2, -0.5, 0))),
            rt.Torus(
                major_radius=0.75,
                minor_radius=0.25,
                transform=(turned(50.0, (1, 1, 0)), at(0, 0.25, 1)),
            ),
            rt.Quadric(
                coefficients=saddle,
                lower=(-1, -1, -1),
                upper=(1, 1, 1),
                transform=(turned(25.0, (1, 3, 2)), at(2, 0.5, -0.5)),
            ),
            rt.Quadric(
                coefficients=bowl,
                lower=(-1, -1, 0),
                upper=(1, 1, 0.75),
                capped=True,
                transform=(turned(-60.0), at(-0.5, 0.75, -1.5)),
            ),
            rt.Sphere(transform=(scaled(0.25, 0.5, 1.0), turned(60.0), at(1.5, -0.5, 1.5))),
            rt.Polygon(rings=(star,), fill="even_odd", transform=(turned(15.0), at(-2, 1.5, 1))),
            rt.Cylinder(radius=0.25, transform=(turned(70.0), at(0.75, 1.25, 0.5))),
        ),
    )


def solids(folder: Path) -> rt.Scene:
    """Set operations: a hollow box, a ring cut by a box, a bite out of a mesh."""
    dice = rt.Difference(
        of=(
            rt.Box(transform=(scaled(0.5),)),
            rt.Sphere(radius=0.625),
            rt.Sphere(radius=0.25, center=(0.5, 0.5, 0.5)),
        ),
        transform=(scaled(2.0), turned(90.0), at(-1, 0, 1.5)),
    )
    ring = rt.Intersection(
        of=(
            rt.Torus(major_radius=0.5, minor_radius=0.25),
            rt.Box(transform=(scaled(0.5, 0.75, 0.75), turned(30.0))),
        ),
        transform=(scaled(1.5), turned(45.0), at(1.5, 0, 1)),
    )
    apple = rt.Difference(
        of=(
            rt.Mesh(file=BALL),
            rt.Sphere(center=(0.75, 0.5, 0.75), radius=0.75),
            rt.Cylinder(radius=0.25, capped=True, transform=(scaled(1, 1, 4), at(0, 0, -2))),
        ),
        transform=(at(0.5, 1, -1.5),),
    )
    return in_folder(
        folder,
        integrator=rt.RayCast(),
        hierarchy="sah",
        shapes=(rt.Rectangle(transform=FLOOR), dice, ring, apple),
    )


_LAMP = (scaled(0.75, 0.75, 1.0), turned(90.0), at(0.5, 3.0, 0.5))

_TEXTURES = {
    "squares": rt.Checker(first=(0.8, 0.7, 0.2), second=(0.2, 0.3, 0.5), uv=UvMap(scale=(8, 8)))
}
_MATERIALS = {
    "floor": rt.Diffuse(reflectance="squares"),
    "clay": rt.Diffuse(reflectance=(0.7, 0.4, 0.3)),
    "silver": rt.Mirror(reflectance=(0.9, 0.9, 0.9)),
    "glass": rt.Dielectric(),
    "gold": rt.RoughConductor(eta=(0.14, 0.37, 1.44), k=(3.98, 2.38, 1.6), alpha=(0.25, 0.25)),
    "lamp": rt.Emissive(radiance=(9, 8, 7)),
}


def whitted(folder: Path) -> rt.Scene:
    """A textured floor, clay, a mirror, glass and gold; lights that throw sharp shadows; one ray a
    pixel, and all that it is mirrored and refracted into."""
    return in_folder(
        folder,
        integrator=rt.Whitted(max_depth=4),
        sampler=rt.Grid(spp=1),
        hierarchy="sah",
        textures=_TEXTURES,
        materials=_MATERIALS,
        shapes=_lit_shapes(lamp=False),
        lights=(
            rt.Point(position=(-2, 5, 4), intensity=(30, 28, 26)),
            rt.Spot(origin=(4, 4, 3), target=(0, -1, 0), intensity=(40, 40, 50), cutoff_angle=40),
            rt.Directional(direction=(1, -4, -2), irradiance=(0.5, 0.5, 0.5)),
        ),
    )


def path(folder: Path) -> rt.Scene:
    """The same shapes lit by a lamp, a glowing ball and the sky, path-traced with 4 samples."""
    return in_folder(
        folder,
        integrator=rt.Path(max_depth=4),
        sampler=rt.Sobol(spp=4, seed=3),
        hierarchy="sah",
        textures=_TEXTURES,
        materials=_MATERIALS,
        shapes=_lit_shapes(lamp=True),
        lights=(rt.Constant(radiance=(0.1, 0.15, 0.25)),),
    )


def _lit_shapes(lamp: bool) -> tuple[Any, ...]:
    shapes = (
        rt.Rectangle(material="floor", transform=FLOOR),
        rt.Sphere(material="silver", center=(-1.5, 0, -0.5), radius=1.0),
        rt.Sphere(material="glass", center=(0.5, -0.25, 1.5), radius=0.75),
        rt.Sphere(material="gold", center=(2.25, -0.25, 0.25), radius=0.75),
        rt.Box(material="clay", transform=(scaled(0.5), turned(30.0, (0, 1, 0)), at(-1, -0.5, 2))),
        rt.Mesh(material="clay", file=BALL, transform=(scaled(0.75), at(0.5, 0.75, -1.5))),
    )
    if not lamp:
        return shapes
    glow = rt.Sphere(material="lamp", center=(-2.5, 1.5, 1), radius=0.25)
    return (*shapes, rt.Rectangle(material="lamp", transform=_LAMP), glow)

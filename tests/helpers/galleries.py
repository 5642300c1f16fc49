"""Scenes with every type of shape, of material and texture, or of light: the examples of the types,
so that a new type is in them once it is registered."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import reference_rt as rt
from reference_rt.core import transform
from reference_rt.core.model import types_of
from reference_rt.lights import AnyLight
from reference_rt.materials import AnyMaterial
from reference_rt.scene.examples import NAMED, examples, write_files
from reference_rt.shapes import Primitive
from reference_rt.shapes.csg import AnyShape
from reference_rt.textures import AnyTexture

COLUMNS = 8
APART = 2.5

SKY = rt.Constant(radiance=(0.2, 0.3, 0.4))


def every_shape(number: int) -> list[Any]:
    """One example of each type, by its number."""
    return [examples(of)[number] for of in types_of(AnyShape)]


def tilted(rng: np.random.Generator, k: int, mirrored: bool) -> tuple[Any, ...]:
    """A map that turns, shears, stretches and, or not, mirrors; each somewhere else."""
    axis = rng.normal(size=3)
    turn = transform.Rotate(
        rotate=transform.Turn(axis=tuple(axis), degrees=float(rng.uniform(0, 360)))
    )
    linear = np.eye(3) + 0.3 * rng.uniform(-1, 1, (3, 3))
    if mirrored:
        linear[:, 0] *= -1.0
    matrix = np.column_stack([linear, 2.5 * np.array([k % 4, k // 4 % 4, 0.3 * k])])
    rows = tuple(tuple(map(float, row)) for row in matrix)
    return turn, transform.Matrix(matrix=rows)


def gallery_of_shapes(folder: Path) -> rt.Scene:
    """All examples of all shapes, tilted, in turns grey, of glass and lamps: but planes, solids and
    copies, which are no lamps.  folder: gets the files that they name."""
    rng, shapes = np.random.default_rng(1), []
    for k, shape in enumerate(examples(AnyShape)):
        material: str | None = ("grey", "glass", "lamp")[k % 3]
        if isinstance(shape, rt.Instance):
            material = None
        elif isinstance(shape, rt.Plane) or type(shape) not in types_of(Primitive):
            material = "grey"
        steps = tilted(rng, 0, k % 2 == 0)
        if isinstance(shape, rt.Plane):  # it would cut the others, or hide them
            steps = (transform.Translate(translate=(0, 0, -4)),)
        shapes.append(shape.model_copy(update={"material": material, "transform": steps}))
    materials = {
        "grey": rt.Diffuse(reflectance=(0.6, 0.6, 0.6)),
        "glass": rt.Dielectric(),
        "lamp": rt.Emissive(radiance=(5, 4, 3), base="grey"),
    }
    return _gallery(folder, shapes, materials)


def gallery_of_materials(folder: Path) -> rt.Scene:
    """All examples of all materials, on spheres, and of all textures, on meshes with two sets of uv
    and colours; but of Phong materials those that create no energy, as path tracing demands, and
    no boundaries without a surface, which Whitted's ray tracing does not follow."""
    some = [m for m in examples(AnyMaterial) if not isinstance(m, rt.Phong | rt.NoSurface)]
    some += [m for m in examples(rt.Phong) if m.specular == (0.0, 0.0, 0.0) or m.half_vector]
    materials = {f"{material.type} {k}": material for k, material in enumerate(some)}
    textures = {f"{t.type} {k}": t for k, t in enumerate(examples(AnyTexture))}
    painted = {f"with {name}": rt.Diffuse(reflectance=name) for name in textures}
    shapes = [rt.Sphere(material=name) for name in materials]
    shapes += [examples(rt.Mesh)[2].model_copy(update={"material": name}) for name in painted]
    return _gallery(folder, shapes, materials | painted, textures)


def gallery_of_lights(folder: Path) -> rt.Scene:
    """All examples of all lights but environments, of which there is one, and of all lamps on
    spheres: so many that a tree picks them."""
    lamps = {f"lamp {k}": lamp for k, lamp in enumerate(examples(rt.Emissive))}
    shapes = [rt.Sphere(material=name) for name in ("base", "other", *lamps)]
    lights = [
        light
        for light in examples(AnyLight)
        if not isinstance(light, rt.Constant | rt.EnvironmentMap)
    ]
    return _gallery(folder, shapes, lamps, {}, [*lights, examples(rt.EnvironmentMap)[1]])


def _gallery(
    folder: Path,
    shapes: Sequence[Any],
    materials: Mapping[str, Any],
    textures: Mapping[str, Any] | None = None,
    lights: Sequence[Any] = (rt.Point(position=(0, 9, 9), intensity=(90, 90, 90)), SKY),
) -> rt.Scene:
    """Shapes in rows, each moved by its own map."""
    write_files(folder)
    rows, placed = -(-len(shapes) // COLUMNS), []
    for k, shape in enumerate(shapes):
        at = APART * np.array([k % COLUMNS - (COLUMNS - 1) / 2, k // COLUMNS - (rows - 1) / 2, 0.0])
        steps = (*shape.transform, transform.Translate(translate=tuple(at.tolist())))
        placed.append(shape.model_copy(update={"transform": steps}))
    scene = rt.Scene(
        camera=rt.Perspective(eye=(0, 3, 2.5 * max(COLUMNS, rows)), target=(0, 0, 0), fov=60),
        film=rt.Film(width=12, height=8, filter=rt.GaussianFilter()),
        sampler=rt.Sobol(spp=2, seed=3),
        integrator=rt.Path(rr_depth=2),
        textures=NAMED["textures"] | (textures or {}),
        materials=NAMED["materials"] | materials,
        groups=NAMED["groups"],
        shapes=placed,
        lights=lights,
    )
    return rt.Scene.parse(scene.to_json(), folder=folder)


GALLERIES = (gallery_of_shapes, gallery_of_materials, gallery_of_lights)

"""Solids (CSG) of many operands against solids of few: how their pictures' time grows."""

import numpy as np

from comparisons.experiments.bench.row import Row, Setting, against, alternate, seconds
from reference_rt.cameras.film import BoxFilter, Film
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Sobol
from reference_rt.shapes import Box, Sphere
from reference_rt.shapes.shape import Difference, Union

FEW, MANY = 4, 256
"""Operands."""

GOAL = 4.0
"""Of the times' ratio.  A ray that ends at the first of many balls of the same total volume comes
to about as many boxes as there are levels of a hierarchy, 4 for 256 and 1 for 4."""

SIZE, SPP = (96, 72), 16

OPERATIONS = ("union", "difference")


def solid_of(operation: str, operands: int) -> Union | Difference:
    """Balls at random places in a cube, so large that their number does not change their volume;
    or the cube without them."""
    rng = np.random.default_rng(operands)
    radii = 0.62 * operands ** (-1.0 / 3.0) * rng.uniform(0.6, 1.2, operands)
    centers = rng.uniform(-1.0, 1.0, (operands, 3)).tolist()
    balls = tuple(
        Sphere(center=center, radius=radius)
        for center, radius in zip(centers, radii.tolist(), strict=True)
    )
    return Union(of=balls) if operation == "union" else Difference(of=(Box(), *balls[1:]))


def scene_of(operation: str, operands: int) -> Scene:
    """The solid alone under an even sky, by paths of at most three edges."""
    described = {
        "camera": {"type": "perspective", "eye": [2.5, 1.8, 4.0], "target": [0, 0, 0], "fov": 35},
        "integrator": {"type": "path", "max_depth": 3},
        "lights": [{"type": "constant", "radiance": 1.0}],
    }
    width, height = SIZE
    return Scene.model_validate(described).changed(
        shapes=(solid_of(operation, operands),),
        film=Film(width=width, height=height, filter=BoxFilter()),
        sampler=Sobol(spp=SPP),
    )


def measure(setting: Setting) -> list[Row]:
    """A row for each operation."""
    found = []
    for operation in OPERATIONS:
        scenes = {n: scene_of(operation, n) for n in (FEW, MANY)}
        for scene in scenes.values():
            render(scene)  # compile, and build

        def time_of(n: int, scenes: dict[int, Scene] = scenes) -> float:
            scene = scenes[n]
            return seconds(lambda: render(scene, tables=scene.tables, threads=setting.threads))

        times = alternate(
            {"few": lambda: time_of(FEW), "many": lambda: time_of(MANY)}, say=setting.say
        )
        found.append(
            against(
                f"solids_{operation}",
                f"{operation} of {MANY} operands, {SIZE[0]}x{SIZE[1]}, {SPP} samples per pixel: "
                f"time / of {FEW}",
                times["many"],
                (f"of {FEW}", times["few"]),
                GOAL,
                details={"seconds": times, "threads": setting.threads},
            )
        )
    return found

"""A scene for the gate, pictures of it, and the gate's verdict on them: for its tests."""

import importlib.metadata
import json
from pathlib import Path
from typing import Any

import numpy as np
from command_line import invoke
from typer.testing import Result

from reference_rt.core.arrays import FloatArray
from reference_rt.core.exr import write_exr
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene

# Where the package is installed pytest finds the plugin by itself, and takes it once only.
PLUGIN = (
    ()
    if any(
        e.module == "comparisons.gate.pytest_plugin"
        for e in importlib.metadata.entry_points(group="pytest11")
    )
    else ("-p", "comparisons.gate.pytest_plugin")
)

BALL = """\
camera: {type: perspective, eye: [0, 0, 4], target: [0, 0, 0], fov: 40}
materials: {grey: {type: diffuse, reflectance: 0.5}}
shapes: [{type: sphere, radius: 1, material: grey}]
"""
"""A scene without film, sampler and lights."""

SCENE = """\
film: {width: 32, height: 32}
camera: {type: perspective, eye: [0, 0, 4], target: [0, 0, 0], fov: 40}
sampler: {type: sobol, spp: 16}
materials:
  grey: {type: diffuse, reflectance: 0.5}
  lamp: {type: emissive, radiance: [60, 50, 20]}
shapes:
  - {type: sphere, radius: 1, material: grey}
  - {type: sphere, center: [2, 2, 2], radius: 0.5, material: lamp}
lights:
  - {type: constant, radiance: [0.5, 0.4, 0.3]}
"""
LIMIT = "0.01"


def pictures(scene: str = SCENE, count: int = 4, spp: int = 256) -> FloatArray:
    described = Scene.parse(scene)
    sampler = described.resolved_sampler
    return np.stack(
        [
            render(
                described.changed(sampler=sampler.model_copy(update={"seed": 70 + k, "spp": spp}))
            ).colour
            for k in range(count)
        ]
    )


BALL_ON_A_FLOOR = """
camera: {type: perspective, eye: [0, 2, 5], target: [0, 0.4, 0], fov: 40}
film: {width: 48, height: 32}
sampler: {type: grid, spp: 4}
integrator: {type: direct}
materials:
  floor: {type: diffuse, reflectance: [0.6, 0.5, 0.4]}
  ball: {type: phong, diffuse: 0.1, specular: 0.3, exponent: 20}
shapes:
  - {type: sphere, center: [0, 0.5, 0], radius: 0.5, material: ball}
  - type: rectangle
    material: floor
    transform: [{scale: 3}, {rotate: {axis: [1, 0, 0], degrees: -90}}]
lights:
  - {type: point, position: [2, 3, 2], intensity: [40, 50, 60]}
"""


def run(*arguments: str) -> tuple[Result, Any]:
    """`gate` with these, and the case in its results.json."""
    result = invoke("gate", *arguments, "--limit", LIMIT)
    path = Path("out/results.json")
    return result, json.loads(path.read_text()) if path.exists() else None


def write(name: str, picture: FloatArray, names: str = "RGB") -> str:
    write_exr(Path(name), {n: picture[..., k % 3] for k, n in enumerate(names)}, {})
    return name


def files(replicates: FloatArray) -> list[str]:
    return [write(f"c{k}.exr", picture) for k, picture in enumerate(replicates)]


def status(found: Any, rung: str) -> str:
    return str(found["cases"][0]["tiers"][rung]["status"])

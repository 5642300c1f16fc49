"""Six small scenes by each renderer, judged by the gate: `python docs/measure_renderers.py NAME...`.

`NAME=PYTHON` draws in another environment, since some packages exclude others.  Each scene is drawn
by `drivers` with the numbers of its lights as they stand, and judged by `gate --from
NAME:numbers`.  A cell that does not agree has a formula below, and what is left of the picture
beyond it.
"""

import json
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from comparisons.gate.conventions import RENDERERS
from comparisons.gate.pictures_in import Picture
from comparisons.gate.request import Request, gated
from comparisons.gate.undone import NUMBERS, Reading
from comparisons.results.case import Case
from comparisons.rungs.edges import DARK, TOLERANCE
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene

sys.path.insert(0, str(Path(__file__).with_name("drivers")))
from draw import BY_CENTRES, drawn_by
from words import HasNoneError, Words

Array = npt.NDArray[Any]


def _place(across: Any, up: Any, normal: Any, at: Any) -> list[Words]:
    return [{"matrix": np.stack([across, up, normal, at], axis=1).tolist()}]


def _turned(axis: Any, degrees: float, half: float, at: Any) -> list[Words]:
    """A square or cube of half a side, turned."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    a = np.radians(degrees)
    turn = np.eye(3) + np.sin(a) * k + (1.0 - np.cos(a)) * k @ k
    return _place(*(half * turn.T), at)


BALL = {"type": "sphere", "center": (0.2, 0.1, -4.0), "radius": 0.8, "material": "it"}
SUN = (-0.3, -0.4, -float(np.sqrt(0.75)))
AMBER = (0.9, 0.6, 0.3)
WALL = {"type": "rectangle", "material": "wall"}
MATTE = {"type": "diffuse", "reflectance": (0.7, 0.5, 0.3)}

PARALLEL = [{"type": "directional", "direction": SUN, "irradiance": (1.1, 0.9, 0.7)}]
PHONG = {"type": "phong", "diffuse": (0.16, 0.12, 0.08), "specular": 0.1, "exponent": 20}

SCENES: dict[str, Words] = {
    "diffuse": {
        "materials": {"it": {"type": "diffuse", "reflectance": (0.8, 0.5, 0.3)}},
        "shapes": [BALL],
        "lights": PARALLEL,
    },
    "mirror": {
        "materials": {
            "it": {"type": "emissive", "radiance": AMBER},
            "wall": {"type": "mirror", "reflectance": 1.0},
        },
        "shapes": [
            {**BALL, "center": (-0.7, 0.1, -4.0), "radius": 0.5},
            {**WALL, "transform": _turned((0, 1, 0), -14.0, 1.2, (0.4, 0.0, -5.5))},
        ],
    },
    "glass": {
        "materials": {
            "it": {"type": "dielectric", "interior_ior": 1.5},
            "wall": {"type": "emissive", "radiance": AMBER},
        },
        "shapes": [
            {
                "type": "box",
                "material": "it",
                "transform": _turned((0.3, 1.0, 0.2), 25.0, 0.6, (0.05, 0.0, -4.0)),
            },
            {**WALL, "transform": _turned((0, 0, 1), 0.0, 1.0, (0.5, 0.2, -7.0))},
        ],
    },
    "Phong": {"materials": {"it": PHONG}, "shapes": [BALL], "lights": PARALLEL},
    "point lamp": {
        "materials": {"wall": MATTE, "it": {"type": "diffuse", "reflectance": 0.0}},
        "shapes": [
            {**BALL, "center": (0.15, 0.1, -4.0), "radius": 0.4},
            {**WALL, "transform": _turned((1, 1, 0), 15.0, 4.0, (0.0, 0.0, -5.5))},
        ],
        "lights": [{"type": "point", "position": (-0.8, 0.9, -2.5), "intensity": (5, 4, 3)}],
    },
    "area lamp": {
        "materials": {"wall": MATTE, "it": {"type": "emissive", "radiance": (6, 5, 4)}},
        "shapes": [
            {
                "type": "rectangle",
                "material": "it",
                "transform": _turned((1, 0, 0.2), 130.0, 0.5, (0.3, 2.0, -2.5)),
            },
            {**WALL, "transform": _turned((1, 0, 0), -40.0, 6.0, (0.0, 0.0, -5.0))},
        ],
    },
}
"""In view of an eye at the origin that looks along -z."""

METAL = {"type": "rough_conductor", "eta": 1e-9, "k": 1.0, "alpha": 0.3}
HALF_VECTOR = {**PHONG, "half_vector": True}
NEAREST = {
    **dict.fromkeys(("cycles", "luxcore", "mitsuba", "raysect"), METAL),
    **dict.fromkeys(("three", "babylon"), HALF_VECTOR),
}
"""In place of Phong's, of renderers that have none: a metal of GGX microfacets that reflects all,
or Blinn's half vector."""



def described(name: str, scene: str) -> Words:
    """As the renderer gets it: it takes light by way of one surface, and glass to its end."""
    said = SCENES[scene]
    if scene == "Phong" and name in NEAREST:
        said = {**said, "materials": {"it": NEAREST[name]}}
    by_centres = name in BY_CENTRES and scene != "area lamp"
    spp = 1 if by_centres else 256 if scene in ("glass", "mirror") else 64
    return {
        "camera": {"type": "perspective", "eye": (0, 0, 0), "target": (0, 0, -1), "fov": 40.0},
        "film": {"width": 64, "height": 48},
        "sampler": {"type": "grid" if by_centres else "sobol", "spp": spp},
        "integrator": {
            "type": "whitted" if by_centres else "path",
            "max_depth": 60 if by_centres else 64,
        },
        **said,
    }


def drawn(name: str, scene: Words, python: str = "") -> Array:
    """(replicates, height, width, 3).  Raises HasNoneError."""
    seeds, spp = [1001, 2002, 3003, 4004], scene["sampler"]["spp"]
    if not python:
        return drawn_by(name, scene, seeds, spp)
    with tempfile.TemporaryDirectory() as folder:
        file, out = Path(folder) / "scene.json", Path(folder) / "out.npy"
        file.write_text(json.dumps(scene), encoding="utf-8")
        given = [str(file), str(out), ",".join(map(str, seeds)), str(spp)]
        command = [python, str(Path(__file__).parent / "drivers" / "draw.py"), name, *given]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode == 3:
            raise HasNoneError(done.stdout.strip().splitlines()[-1])
        if not out.exists():
            raise SystemExit((done.stdout + done.stderr)[-2000:])
        return np.asarray(np.load(out))


def judged(name: str, said: Words, pictures: Array) -> Case:
    scene = Scene.parse(json.dumps(said))
    kinds = {light["type"] for light in said.get("lights", [])}
    numbers = RENDERERS[name].changes.seen(kinds).lights
    reading = Reading.of(f"{name}:{NUMBERS}" if numbers else name, scene, of_files=False)
    known = reading.scene(scene)
    assert known is not None
    if name not in BY_CENTRES:
        request = Request(known, limit=0.01)
    elif said["sampler"]["type"] == "grid":
        # Files of 16 bits: a code, of the darkest value that is judged by itself.
        code = 2.0**-16 / (DARK * float(render(known).colour.mean(axis=(0, 1)).min()))
        request = Request(known, noise_free=True, tolerance=max(TOLERANCE, code))
    else:
        fine = known.changed(sampler=known.resolved_sampler.model_copy(update={"spp": 4096}))
        request = Request(references=(Picture(render(fine).colour),), noise_free=True)
    return reading.told(gated(request, reading.read([Picture(one) for one in pictures])))


def main(*names: str) -> None:
    for one in names:
        name, _, python = one.partition("=")
        for scene in SCENES:
            said = described(name, scene)
            try:
                pictures = drawn(name, said, python)
            except HasNoneError as error:
                print(f"{name} | {scene} | none: {error}", flush=True)
                continue
            np.save(f"/tmp/rnd/{name}_{scene.replace(' ', '_')}.npy", pictures)
            case = judged(name, said, pictures)
            cause = "" if case.cause is None else case.cause.name
            print(f"{name} | {scene} | {case.verdict} | {case.reason} | {cause}", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])

"""What drivers share: the words of the scene, its sizes, and meshes of its shapes."""

import math
import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Words = dict[str, Any]
Driver = Callable[[Words, Path, Sequence[int], int], Iterator[Array]]
"""From a scene, a folder, seeds and samples of a pixel to a picture (height, width, 3) for each
seed, or one if there are no random numbers.  Raises HasNoneError."""

SMALL, SUN = 1e-3, 0.01
"""Radius of the balls that stand for points, and degrees across the disc that stands for parallel
light, where a renderer has neither."""

NEAR = 1e-3
"""POV-Ray's `fade_distance`, below which its points do not fade."""


class HasNoneError(Exception):
    """The renderer lacks a word of the scene."""


def rgb(value: Any) -> tuple[float, float, float]:
    r, g, b = np.broadcast_to(np.asarray(value, float), 3).tolist()
    return r, g, b


def text(values: Any) -> str:
    return " ".join(f"{v:.9g}" for v in np.ravel(values))


def commas(values: Any) -> str:
    return f"<{', '.join(f'{v:.12g}' for v in np.ravel(values))}>"


def size(scene: Words) -> tuple[int, int, float, float]:
    """Pixels, and half the view at distance 1, across and up."""
    width, height = scene["film"]["width"], scene["film"]["height"]
    half = math.tan(math.radians(scene["camera"]["fov"] / 2.0))
    return width, height, half, half * height / width


def longer(scene: Words) -> float:
    """Degrees along the longer side."""
    _, _, x, y = size(scene)
    return 2.0 * math.degrees(math.atan(max(x, y)))


def placed(shape: Words) -> Array:
    """(4, 4): from the square or the cube of side 2 to the scene."""
    (step,) = shape["transform"]
    return np.vstack([np.array(step["matrix"], float), [0.0, 0.0, 0.0, 1.0]])


FACES = [[[x, -1, -1], [x, x, -x], [x, 1, 1], [x, -x, x]] for x in (-1, 1)]
CUBE = np.array([np.roll(face, turn, axis=1) for face in FACES for turn in range(3)], float)
"""(6, 4, 3): corners of the cube's faces, counter-clockwise from outside."""
SQUARE = np.array([[[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]], float)


def quads(shape: Words) -> Array:
    """(n, 4, 3): a rectangle's or a box's."""
    matrix = placed(shape)
    corners = CUBE if shape["type"] == "box" else SQUARE
    return np.asarray(corners @ matrix[:3, :3].T + matrix[:3, 3])


def mesh(shape: Words, n: int = 128) -> tuple[Array, Array, Array | None]:
    """Corners, triangles, and normals where they are smooth, for renderers that have no others."""
    if shape["type"] != "sphere":
        corners = quads(shape)
        first = 4 * np.arange(len(corners))[:, None]
        both = [first + np.array(ends) for ends in ((0, 1, 2), (0, 2, 3))]
        return corners.reshape(-1, 3), np.concatenate(both), None
    theta, phi = np.linspace(0.0, math.pi, n + 1), np.arange(2 * n) * math.pi / n
    t, p = np.meshgrid(theta, phi, indexing="ij")
    unit = np.stack([np.sin(t) * np.cos(p), np.cos(t), np.sin(t) * np.sin(p)], axis=-1)
    unit = unit.reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n), np.arange(2 * n), indexing="ij")
    a, b = i * 2 * n + j, i * 2 * n + (j + 1) % (2 * n)
    upper, lower = np.stack([a, b, a + 2 * n], -1)[1:], np.stack([b, b + 2 * n, a + 2 * n], -1)[:-1]
    faces = np.concatenate([upper.reshape(-1, 3), lower.reshape(-1, 3)])
    return unit * shape["radius"] + shape["center"], faces, unit


def inside(scene: Words) -> bool:
    """Whether the eye is inside of a ball."""
    balls = [shape for shape in scene["shapes"] if shape["type"] == "sphere"]
    return any(math.dist((0, 0, 0), ball["center"]) < ball["radius"] for ball in balls)


def look(scene: Words, shape: Words) -> tuple[str, Words]:
    material = scene["materials"][shape["material"]]
    return str(material["type"]), material


def lights(scene: Words) -> list[tuple[str, Words]]:
    return [(str(light["type"]), light) for light in scene.get("lights", [])]


def axis(light: Words) -> Array:
    """The unit direction of a spot."""
    along = np.subtract(light["target"], light["origin"])
    return np.asarray(along / np.linalg.norm(along))


def words(name: str, table: dict[str, Any], what: str) -> Any:
    if what not in table:
        raise HasNoneError(f"{name} has no {what}")
    return table[what]


def run(*command: str, folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{command[0]}: {(done.stdout + done.stderr)[-800:]}")
    return done.stdout


def ppm16(file: Path, width: int, height: int) -> Array:
    """The last picture of 16 bits of a PPM file."""
    data = file.read_bytes()[-6 * width * height :]
    return np.frombuffer(data, ">u2").reshape(height, width, 3) / 65535.0

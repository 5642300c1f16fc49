"""Small images, environment maps and mesh files that random scenes name."""

import shutil
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.experiments.fuzz.data import Data
from comparisons.experiments.stability.hostile.bases import COPIES, MESHES
from comparisons.experiments.stability.hostile.bases import files as sound_files
from reference_rt.core.exr import write_exr
from reference_rt.util.files import replacing

IMAGES = ("square.png", "wide.png", "grey.png")
NORMALS = "normals.png"
"""An image of normals that lean by up to 40 degrees: of others, some would point below the surface,
where Mitsuba's normal maps reflect no ambient light."""

SKIES = ("sky.exr", "low_sky.exr")

FINE = "fine.ply"
"""A ball of 5,120 triangles: few faults of a hierarchy show in small ones."""

FILES: dict[str, tuple[str, ...]] = {
    "bitmap": IMAGES,
    "environment_map": SKIES,
    "mesh": (*MESHES, FINE),
    "instance": (COPIES,),
}
"""Names of files by the type whose `file` they can be."""


@cache
def write(folder: Path) -> Path:
    """Write the files into a folder unless they are there; returns the folder."""
    import trimesh
    from PIL import Image

    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(0)
    sizes = {"square.png": (8, 8, 3), "wide.png": (4, 6, 3), "grey.png": (8, 8)}
    for name, size in sizes.items():
        pixels = rng.integers(30, 225, size).astype(np.uint8)
        if not (folder / name).exists():
            with replacing(folder / name) as temporary:
                Image.fromarray(pixels).save(temporary, "PNG")
    for name, height in zip(SKIES, (8, 3), strict=True):
        sky = rng.uniform(0.05, 1.0, (height, 2 * height, 3))
        sky[height // 3, height // 2] = 8.0
        if not (folder / name).exists():
            write_exr(folder / name, {c: sky[..., k] for k, c in enumerate("RGB")}, {})
    if not (folder / NORMALS).exists():
        low, high = np.array([80, 80, 200]), np.array([175, 175, 255])
        with replacing(folder / NORMALS) as temporary:
            Image.fromarray(rng.integers(low, high, (6, 6, 3)).astype(np.uint8)).save(
                temporary, "PNG"
            )
    for name in (*MESHES, COPIES):
        if not (folder / name).exists():
            with replacing(folder / name) as temporary:
                temporary.write_bytes(sound_files()[name])
    if not (folder / FINE).exists():
        with replacing(folder / FINE) as temporary:
            ball = trimesh.creation.icosphere(subdivisions=4)
            temporary.write_bytes(ball.export(file_type="ply"))
    return folder


def bring(scene: Data, folder: Path, to: Path) -> None:
    """Copy the files that a scene names from its own folder to another one."""
    to.mkdir(parents=True, exist_ok=True)
    for name in _named(scene):
        source, target = folder / name, to / name
        if source.exists() and source.resolve() != target.resolve():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)


def _named(part: Any) -> Iterator[str]:
    if isinstance(part, dict):
        for key, value in part.items():
            if key == "file" and isinstance(value, str):
                yield value
            else:
                yield from _named(value)
    elif isinstance(part, list):
        for value in part:
            yield from _named(value)

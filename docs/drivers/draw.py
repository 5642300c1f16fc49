"""Draws a small scene by another renderer: what both measurements of renderers share.

`python docs/drivers/draw.py NAME scene.json out.npy SEEDS SPP` writes (seeds, height, width, 3)
as the renderer gives it, unturned.  The scene is one of ours, of few words: a camera at the origin
that looks along -z with `fov` across, spheres, and rectangles and boxes with a `matrix` each; the
materials and lights of `words`.  Numbers of lights are copied as they stand.

It needs NumPy and the renderer: tachyon and POV-Ray by apt, bpy, pyluxcore, pyradiance, raysect and
mitsuba by pip in the environment that runs it, since some exclude others.  `browsers` has three.js
and Babylon.js.
"""

import json
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from browsers import babylon, three
from by_centres import povray, radiance, tachyon
from by_chance import cycles, luxcore, mitsuba, raysect
from words import Array, Driver, HasNoneError, Words

BY_CENTRES: dict[str, Driver] = {
    one.__name__: one for one in (babylon, povray, radiance, tachyon, three)
}
"""One sample of each pixel, no random numbers."""
BY_CHANCE: dict[str, Driver] = {one.__name__: one for one in (cycles, luxcore, mitsuba, raysect)}
DRIVERS = {**BY_CENTRES, **BY_CHANCE}


def drawn_by(name: str, scene: Words, seeds: Sequence[int] = (1,), spp: int = 64) -> Array:
    """(seeds, height, width, 3), of one picture where there are no random numbers."""
    with tempfile.TemporaryDirectory() as folder:
        return np.stack(list(DRIVERS[name](scene, Path(folder), seeds, spp)))


if __name__ == "__main__":
    name, scene_file, out, seeds, spp = sys.argv[1:]
    out = str(Path(out).absolute())
    described = json.loads(Path(scene_file).read_text(encoding="utf-8"))
    try:
        np.save(out, drawn_by(name, described, [int(k) for k in seeds.split(",")], int(spp)))
        code = 0
    except HasNoneError as error:
        print(error, flush=True)
        code = 3
    os._exit(code)  # pyluxcore and bpy need not be taken down

"""Measures a renderer's conventions: `python docs/measure_conventions.py NAME` prints them as JSON.

It needs the renderer and NumPy alone, as `drivers` say; three.js and Babylon.js this project too.

Three pictures of 64 x 64 pixels, 40 degrees wide, from the origin along -z, y up:
- a shining ball, off the middle: the turn and the shift with which its formula fits best;
- an even sky seen from inside glass of index 1.5: 2.25 times its radiance where radiance is divided
  by the square of the index, else 1;
- a matte wall of albedo 0.5, 5 from each lamp: its light, as a multiple of what a lamp of as many
  W/sr (point, spot), W/m2 (directional) or W/sr/m2 (an even sky) makes of it.
"""

import json
import math
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).with_name("drivers")))
from draw import BY_CENTRES, drawn_by
from words import HasNoneError

Array = npt.NDArray[Any]

N, FOV = 64, 40.0
HALF = math.tan(math.radians(FOV / 2.0))
CENTRE, RADIUS = (0.35, 0.6, -4.0), 0.7
INDEX, ALBEDO, DISTANCE = 1.5, 0.5, 5.0
DIM = 0.4
"""A sky that fits into files whose largest value is 1, also 2.25 times as bright."""


def seen(right: float, down: float, samples: int, cosine: bool = False) -> Array:
    """The formula's picture of the ball, moved, with so many samples along a pixel's side."""
    at = (np.arange(N * samples) + 0.5) / samples
    x, y = HALF * ((at - right) / N * 2.0 - 1.0), HALF * (1.0 - (at - down) / N * 2.0)
    d = np.stack([*np.meshgrid(x, y), -np.ones((at.size, at.size))], axis=-1)
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    along = d @ np.array(CENTRE)
    hit = (along**2 > np.dot(CENTRE, CENTRE) - RADIUS**2) & (along > 0.0)
    values = hit * (-d[..., 2] if cosine else 1.0)
    return np.asarray(values.reshape(N, samples, N, samples).mean(axis=(1, 3)))


def placed(picture: Array, samples: int) -> dict[str, Any]:
    """The turn and the shift, in eighths of a pixel, with the least squared difference."""
    shown = picture / picture.max()
    found = []
    for mirrored in (False, True):
        for upside_down in (False, True):
            turned = shown[:: -1 if upside_down else 1, :: -1 if mirrored else 1]
            for cosine in (False, True):
                step, at = 0.5, (0.0, 0.0)
                for step, reach in ((0.5, 3), (0.125, 4)):
                    fits = [
                        (float(((seen(x, y, samples, cosine) - turned) ** 2).sum()), x, y)
                        for x in at[0] + step * np.arange(-reach, reach + 1)
                        for y in at[1] + step * np.arange(-reach, reach + 1)
                    ]
                    least, *best = min(fits)
                    at = (best[0], best[1])
                found.append((least, mirrored, upside_down, cosine, *at))
    _, mirrored, upside_down, cosine, right, down = min(found, key=lambda one: one[0])
    names = {"mirrored": mirrored, "upside_down": upside_down, "cosine": cosine}
    return {**names, "right": float(right), "down": float(down)}


def words(material: dict[str, Any], *shapes: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {
        "camera": {"fov": FOV},
        "film": {"width": N, "height": N},
        "materials": {"it": material},
        "shapes": [{"material": "it", **shape} for shape in shapes],
        **more,
    }


SHINING, GLASS = (
    {"type": "emissive", "radiance": 1.0},
    {"type": "dielectric", "interior_ior": INDEX},
)
MATTE = {"type": "diffuse", "reflectance": ALBEDO}
BALL = words(SHINING, {"type": "sphere", "center": CENTRE, "radius": RADIUS})
IN_GLASS = words(
    GLASS,
    {"type": "sphere", "center": (0.0, 0.0, 0.0), "radius": 2.0},
    lights=[{"type": "constant", "radiance": DIM}],
)
FAR = [[20.0, 0.0, 0.0, 0.0], [0.0, 20.0, 0.0, 0.0], [0.0, 0.0, 1.0, -4.0]]
LAMPS: dict[str, dict[str, Any]] = {
    "point": {"position": (0.0, 0.0, 1.0), "intensity": 10.0},
    "spot": {"origin": (0.0, 0.0, 1.0), "target": (0.0, 0.0, 0.0), "intensity": 10.0},
    "directional": {"direction": (0.0, 0.0, -1.0), "irradiance": 1.0},
    "constant": {"radiance": DIM},
}


def picture(name: str, said: dict[str, Any], spp: int) -> Array:
    """The mean over channels."""
    return np.asarray(drawn_by(name, said, spp=spp)[0].mean(axis=-1))


def measured(name: str) -> dict[str, Any]:
    """The conventions of a renderer."""
    found: dict[str, Any] = {"glass": None, "lamps": {}}
    found["placed"] = placed(picture(name, BALL, 256), 1 if name in BY_CENTRES else 8)
    x = HALF * ((np.arange(N) + 0.5) / N * 2.0 - 1.0)
    cosines = (1.0 + x**2 + x[:, None] ** 2) ** -0.5 if found["placed"]["cosine"] else 1.0
    with suppress(HasNoneError):
        found["glass"] = float((picture(name, IN_GLASS, 256) / cosines).mean()) / DIM
    # Raysect has no lamps without extent: those of the driver are balls, and no convention of its.
    for kind, lamp in ({} if name == "raysect" else LAMPS).items():
        wall = words(
            MATTE,
            {"type": "rectangle", "transform": [{"matrix": FAR}]},
            lights=[{"type": kind, **lamp}],
        )
        (number,) = (lamp[key] for key in ("intensity", "irradiance", "radiance") if key in lamp)
        by = {"directional": 1.0, "constant": math.pi}.get(kind, DISTANCE**-2.0)
        unit = number * by * ALBEDO / math.pi
        try:
            shown = float(np.median((picture(name, wall, 64) / cosines)[31:33, 31:33]))
        except HasNoneError:
            continue
        found["lamps"][kind] = shown / unit
    return found


if __name__ == "__main__":
    print(json.dumps(measured(sys.argv[1])), flush=True)
    os._exit(0)  # pyluxcore and bpy need not be taken down

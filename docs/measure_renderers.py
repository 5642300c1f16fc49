"""Six small scenes by each renderer, judged by the gate.

`python docs/measure_renderers.py NAME...` draws and judges them; NAME=PYTHON draws in another
environment, since some packages exclude others.  Each scene is drawn by `drivers` with the numbers
of its lights as they stand, and judged as by `gate --from NAME:numbers`.

A line of JSON for each: renderer, scene, verdict, how far its mean is off in percent (or why there
is none), the formula below of what is drawn where that is not ours, percent left beyond it.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
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

CODES = {"povray": 2.0**-16, "tachyon": 2.0**-16}
"""Steps of the files of those that write 16 bits."""

SEEDS = [1 + 1000003 * k for k in range(16)]
WIDTH, HEIGHT, FOV = 64, 48, 40.0


def described(name: str, scene: str) -> Words:
    """As the renderer gets it, and ours: paths as long as glass needs."""
    said = SCENES[scene]
    if scene == "Phong" and name in NEAREST:
        said = {**said, "materials": {"it": NEAREST[name]}}
    noise = name not in BY_CENTRES
    spp = (256 if scene == "glass" else 64) if noise else 1
    return {
        "camera": {"type": "perspective", "eye": (0, 0, 0), "target": (0, 0, -1), "fov": FOV},
        "film": {"width": WIDTH, "height": HEIGHT},
        "sampler": {"type": "sobol" if noise else "grid", "spp": spp},
        "integrator": {"type": "path" if noise else "whitted", "max_depth": 60},
        **said,
    }


def drawn(name: str, scene: Words, python: str = "") -> Array:
    """(replicates, height, width, 3).  Raises HasNoneError."""
    spp = scene["sampler"]["spp"]
    if not python:
        return drawn_by(name, scene, SEEDS, spp)
    with tempfile.TemporaryDirectory() as folder:
        file, out = Path(folder) / "scene.json", Path(folder) / "out.npy"
        file.write_text(json.dumps(scene), encoding="utf-8")
        given = [str(file), str(out), ",".join(map(str, SEEDS)), str(spp)]
        command = [python, str(Path(__file__).parent / "drivers" / "draw.py"), name, *given]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode == 3:
            raise HasNoneError(done.stdout.strip().splitlines()[-1])
        if not out.exists():
            raise SystemExit((done.stdout + done.stderr)[-2000:])
        return np.asarray(np.load(out))


def rays(samples: int = 1, down: float = 0.0) -> Array:
    """(height, width, samples squared, 3): through pixels of a view that is moved."""
    half = np.tan(np.radians(FOV / 2.0))
    at = (np.arange(samples) + 0.5) / samples
    x = half * ((np.arange(WIDTH)[:, None] + at) * 2.0 / WIDTH - 1.0)
    y = half * (HEIGHT - 2.0 * (np.arange(HEIGHT)[:, None] + at - down)) / WIDTH
    x, y = np.broadcast_arrays(x[None, :, None, :], y[:, None, :, None])
    d = np.stack([x, y, -np.ones_like(x)], axis=-1).reshape(HEIGHT, WIDTH, -1, 3)
    return np.asarray(d / np.linalg.norm(d, axis=-1, keepdims=True))


def on_ball(d: Array) -> tuple[Array, Array, Array]:
    """Whether rays meet the ball, its normals, and half vectors of the eye and the sun."""
    c, r = np.array(BALL["center"]), BALL["radius"]
    along = d @ c
    root = along**2 - c @ c + r**2
    n = ((along - np.sqrt(np.maximum(root, 0.0)))[..., None] * d - c) / r
    h = -d - np.array(SUN)
    return root > 0.0, n, h / np.linalg.norm(h, axis=-1, keepdims=True)


SUNLIGHT = np.array(PARALLEL[0]["irradiance"])


def lamp_vectors() -> tuple[Array, Array]:
    """On the wall of the area lamp: the integral of the direction to the lamp over its solid angle,
    an edge at a time (Lambert 1760), and the wall's normal."""
    lamp, wall = (
        np.array(shape["transform"][0]["matrix"]) for shape in SCENES["area lamp"]["shapes"]
    )
    n = wall[:, 2] / np.linalg.norm(wall[:, 2])
    d = rays()[:, :, 0]
    points = d * (wall[:, 3] @ n / (d @ n))[..., None]
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ lamp[:, :2].T + lamp[:, 3]
    v = corners - points[..., None, :]
    w = np.roll(v, -1, axis=-2)
    cross = np.cross(v, w)
    length = np.linalg.norm(cross, axis=-1, keepdims=True)
    angle = np.arctan2(length, (v * w).sum(axis=-1, keepdims=True))
    total = (angle / length * cross).sum(axis=-2) / 2.0
    return total * np.sign(total @ n)[..., None], n


AREA = np.array(MATTE["reflectance"]) * np.array(SCENES["area lamp"]["materials"]["it"]["radiance"])


def lit_by_area() -> Array:
    """The closed form of the area lamp's wall."""
    vectors, n = lamp_vectors()
    return np.asarray((vectors @ n)[..., None] * AREA / np.pi)


def overlaid(known: Scene) -> Array:
    """three's Reflector lays its colour, grey of code 127, over what it mirrors."""
    shown, grey = render(known).colour, ((127.0 / 255.0 + 0.055) / 1.055) ** 2.4
    over = np.where(shown < 0.5, 2.0 * shown * grey, 1.0 - 2.0 * (1.0 - shown) * (1.0 - grey))
    o, d, *_ = known.camera_rays()
    return np.where((known.intersect(o, d).shape == 1)[..., None], over, shown)


def blinn_of_three(known: Scene) -> Array:
    """Blinn's highlight times (n + 2) / (8 pi), Schlick's Fresnel term and the cosine."""
    hit, n, h = on_ball(rays()[:, :, 0])
    cosine, shine = np.maximum(-n @ np.array(SUN), 0.0), (n * h).sum(axis=-1)
    kd, ks, p = np.array(PHONG["diffuse"]), np.pi * PHONG["specular"], PHONG["exponent"]
    # The half vector is as far from the eye as from the sun.
    fresnel = ks + (1.0 - ks) * (1.0 + h @ np.array(SUN)) ** 5
    lobe = fresnel * (p + 2.0) / (8.0 * np.pi) * np.maximum(shine, 0.0) ** p
    return np.asarray((hit * cosine)[..., None] * (kd + lobe[..., None]) * SUNLIGHT)


def area_of_three(known: Scene) -> Array:
    """The vector's length l and its share z along the normal give (l^2 + z) / (l + 1), a form
    factor, in place of z."""
    vectors, n = lamp_vectors()
    z, l = vectors @ n / np.pi, np.linalg.norm(vectors, axis=-1) / np.pi
    return np.asarray(((l**2 + z) / (l + 1.0))[..., None] * AREA)


def area_of_radiance(known: Scene) -> Array:
    """The lamp as the centres of its 64 parts, the most that Radiance has."""
    lamp, wall = (np.array(s["transform"][0]["matrix"]) for s in SCENES["area lamp"]["shapes"])
    n, across = (v / np.linalg.norm(v) for v in (wall[:, 2], lamp[:, 2]))
    d = rays()[:, :, 0]
    points, value = d * (wall[:, 3] @ n / (d @ n))[..., None], 0.0
    for u, v in np.ndindex(8, 8):
        to = lamp[:, :2] @ ((2.0 * np.array([u, v]) + 1.0) / 8.0 - 1.0) + lamp[:, 3] - points
        r2 = (to**2).sum(axis=-1)
        value = value + np.abs((to @ n) * (to @ across)) / r2**2 / 64.0
    size = 4.0 * np.prod(np.linalg.norm(lamp[:, :2], axis=0))
    return np.asarray(value[..., None] * size * AREA / np.pi)


def metal(masked: Callable[[Array, Array, float], Array], down: float) -> Array:
    """GGX microfacets by how much of them both directions see, over their cosines."""
    hit, n, h = on_ball(d := rays(16, down))
    cosine, to_eye = np.maximum(-n @ np.array(SUN), 1e-9), np.maximum(-(n * d).sum(axis=-1), 1e-9)
    a2 = METAL["alpha"] ** 2
    spread = a2 / np.pi / ((n * h).sum(axis=-1) ** 2 * (a2 - 1.0) + 1.0) ** 2
    value = hit * (cosine > 1e-9) * spread * masked(cosine, to_eye, a2) / 4.0 / to_eye
    return np.asarray(value.mean(axis=-1)[..., None] * SUNLIGHT)


def metal_of_luxcore(known: Scene) -> Array:
    """Each direction is masked by Schlick's c / (c (1 - alpha^2) + alpha^2)."""
    return metal(
        lambda i, o, a2: i * o / (i * (1.0 - a2) + a2) / (o * (1.0 - a2) + a2),
        RENDERERS["luxcore"].changes.down,
    )


def metal_of_cycles(known: Scene) -> Array:
    """Both are masked together: 1 / (1 + L(i) + L(o)), Smith's functions, by height."""

    def smith(c: Array, a2: float) -> Array:
        return np.asarray((np.sqrt(1.0 + a2 * (1.0 / c**2 - 1.0)) - 1.0) / 2.0)

    return metal(lambda i, o, a2: 1.0 / (1.0 + smith(i, a2) + smith(o, a2)), 0.0)


FORMULAS: dict[tuple[str, str], Callable[[Scene], Array]] = {
    ("three", "mirror"): overlaid,
    ("three", "Phong"): blinn_of_three,
    ("three", "area lamp"): area_of_three,
    ("luxcore", "Phong"): metal_of_luxcore,
    ("cycles", "Phong"): metal_of_cycles,
    ("radiance", "area lamp"): area_of_radiance,
}
"""What is drawn where that is not ours."""


def judged(name: str, scene: str, said: Words, pictures: Array) -> tuple[Case, str]:
    """The verdict, and by how much the picture's mean is off, in percent."""
    known = Scene.parse(json.dumps(said))
    kinds = {light["type"] for light in said.get("lights", [])}
    numbers = RENDERERS[name].changes.seen(kinds).lights
    reading = Reading.of(f"{name}:{NUMBERS}" if numbers else name, known, of_files=False)
    known = reading.scene(known) or known
    read = reading.read([Picture(one) for one in pictures])
    if name not in BY_CENTRES:
        request = Request(known, limit=0.01)
        fine = known.changed(sampler=known.resolved_sampler.model_copy(update={"spp": 4096}))
        reference = render(fine).colour
    elif scene == "area lamp":
        reference = lit_by_area()
        request = Request(references=(Picture(reference),), noise_free=True)
    else:
        reference = render(known).colour
        # A code of the darkest value that is judged by itself.
        code = CODES.get(name, 0.0) / (DARK * float(reference.mean(axis=(0, 1)).min()))
        request = Request(known, noise_free=True, tolerance=max(TOLERANCE, code))
    means = np.array([one.radiance.mean(axis=(0, 1)) for one in read]) / reference.mean(axis=(0, 1))
    worst = np.abs(means.mean(axis=0) - 1.0).argmax()
    off = f"{100.0 * (means.mean(axis=0)[worst] - 1.0):+.2f}"
    if len(read) > 1:
        off += f" ± {100.0 * means[:, worst].std(ddof=1) / len(read) ** 0.5:.2f}"
    return reading.told(gated(request, read)), off


def explained(name: str, scene: str, said: Words, pictures: Array) -> tuple[str, float]:
    """The formula, and what is left beyond it beside edges: the root mean square, in percent of the
    picture's."""
    formula = FORMULAS[name, scene](Scene.parse(json.dumps(said)))
    shown = pictures.mean(axis=0)
    around = np.pad(formula, ((1, 1), (1, 1), (0, 0)), mode="edge")
    near = np.lib.stride_tricks.sliding_window_view(around, (3, 3), axis=(0, 1))
    high = near.max(axis=(-2, -1))
    inside = near.min(axis=(-2, -1)) > 0.6 * high
    left = float(np.sqrt(((shown - formula)[inside] ** 2).mean() / (shown[inside] ** 2).mean()))
    return FORMULAS[name, scene].__name__, round(100.0 * left, 3)


def main(*names: str) -> None:
    for one in names:
        name, _, python = one.partition("=")
        for scene in SCENES:
            said = described(name, scene)
            try:
                pictures = drawn(name, said, python)
            except HasNoneError as error:
                print(json.dumps([name, scene, "none", str(error), "", None]), flush=True)
                continue
            case, off = judged(name, scene, said, pictures)
            formula, left = "", None
            if (name, scene) in FORMULAS:
                formula, left = explained(name, scene, said, pictures)
            print(json.dumps([name, scene, case.verdict, off, formula, left]), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Each convention that was measured is planted by itself, and named without `--from`.

Pictures are made without the code that undoes them: by the scene's text, and by formulas.
"""

import math

import numpy as np
import pytest

from comparisons.gate.conventions import RENDERERS, Changes
from comparisons.gate.pictures_in import Picture
from comparisons.gate.request import Request, gated
from comparisons.results.case import Cause, FloatArray
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene

WIDTH, HEIGHT, FOV = 36, 24, 40.0
HALF = math.tan(math.radians(FOV / 2.0))
LAMPS = {
    "point": "{{type: point, position: [2, 3, 2], intensity: [{0}, {1}, {2}]}}",
    "spot": "{{type: spot, origin: [2, 3, 2], target: [0, 0, 0], cutoff_angle: 40, "
    "intensity: [{0}, {1}, {2}]}}",
    "directional": "{{type: directional, direction: [-1, -2, -1], irradiance: [{0}, {1}, {2}]}}",
}
NUMBERS = {"point": (9.0, 12.0, 15.0), "spot": (9.0, 12.0, 15.0), "directional": (2.0, 1.5, 1.0)}


def described(
    lamps: dict[str, float],
    view: str = f"fov: {FOV}",
    film: tuple[int, int] = (WIDTH, HEIGHT),
    ball: bool = True,
) -> Scene:
    """A ball on a floor, seen from (0, 2, 5);  lamps: how many times their numbers are as large."""
    shown = "- {type: sphere, center: [0.3, 0.5, 0], radius: 0.5, material: red}" if ball else ""
    lit = [LAMPS[kind].format(*(k * v for v in NUMBERS[kind])) for kind, k in lamps.items()]
    return Scene.parse(f"""
camera: {{type: perspective, eye: [0, 2, 5], target: [0.3, 0.4, 0], {view}}}
film: {{width: {film[0]}, height: {film[1]}}}
sampler: {{type: grid, spp: 1}}
integrator: {{type: direct}}
materials:
  red: {{type: diffuse, reflectance: [0.7, 0.3, 0.2]}}
  grey: {{type: diffuse, reflectance: [0.5, 0.6, 0.7]}}
shapes:
  - type: rectangle
    material: grey
    transform: [{{scale: 90}}, {{rotate: {{axis: [1, 0, 0], degrees: -90}}}}]
  {shown}
lights: [{", ".join(lit)}]
""")


def rays() -> tuple[FloatArray, FloatArray]:
    """Through pixels' centres, and their cosines to the direction of view."""
    forward = np.array([0.3, -1.6, -5.0]) / math.hypot(0.3, 1.6, 5.0)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    x = (2.0 * (np.arange(WIDTH) + 0.5) / WIDTH - 1.0) * HALF
    y = (HEIGHT - 2.0 * (np.arange(HEIGHT) + 0.5)) / WIDTH * HALF
    d = forward + x[None, :, None] * right + y[:, None, None] * np.cross(right, forward)
    length = np.linalg.norm(d, axis=-1)
    return d / length[..., None], 1.0 / length


def unfaded(picture: FloatArray) -> FloatArray:
    """Of the floor alone: times the square of the distance from the lamp."""
    eye = np.array([0.0, 2.0, 5.0])
    d, _ = rays()
    points = eye - d * (eye[1] / d[..., 1])[..., None]
    return np.asarray(picture * ((points - [2.0, 3.0, 2.0]) ** 2).sum(axis=-1)[..., None])


def shared_exponent(pixel: FloatArray) -> list[float]:
    _, exponent = math.frexp(max(pixel))
    return [int(v / 2.0 ** (exponent - 8)) * 2.0 ** (exponent - 8) for v in pixel]


CODED = {
    "an exponent for three channels, mantissas cut off": lambda p: np.apply_along_axis(
        shared_exponent, -1, p
    ),
    "mantissas of 8 bits over 255": lambda p: p / 255.0 * 256.0,
}


def planted(changes: Changes, kinds: list[str]) -> tuple[Scene, FloatArray]:
    """Our scene, and a picture of it with these conventions."""
    film = (HEIGHT, WIDTH) if changes.fov == "larger" else (WIDTH, HEIGHT)
    scene = described(dict.fromkeys(kinds, 1.0), film=film, ball=not changes.unfaded)
    view = f"fov: {FOV}"
    if changes.fov:
        view += ", fov_axis: y"
    if changes.right or changes.down:
        x, y = (2.0 * HALF / WIDTH * by for by in (changes.right, changes.down))
        high = HALF * HEIGHT / WIDTH
        view = f"view: [{-HALF - x}, {HALF - x}, {-high + y}, {high + y}]"
    factors = {kind: changes.lights.get(kind, 1.0) for kind in kinds}
    picture = render(described(factors, view, film, ball=not changes.unfaded)).colour
    picture = unfaded(picture) if changes.unfaded else picture
    picture = picture * rays()[1][..., None] if changes.cosine else picture
    picture = CODED[changes.codes](picture) if changes.codes else picture
    picture = picture[::-1] if changes.upside_down else picture
    return scene, np.ascontiguousarray(picture[:, ::-1] if changes.mirrored else picture)


def cause(scene: Scene, picture: FloatArray) -> Cause:
    case = gated(Request(scene=scene), [Picture(picture)])
    assert case.verdict == "differ"
    assert case.cause is not None
    return case.cause


def _all() -> dict[str, tuple[Changes, list[str]]]:
    """What was measured, each change alone and those of a renderer together, and whose it is."""
    found: list[tuple[Changes, list[str]]] = []
    for one in RENDERERS.values():
        by_light = [Changes(lights={kind: k}) for kind, k in one.changes.lights.items()]
        by_light.append(Changes(lights=one.changes.lights))
        with_light = [one.changes.seen([kind]) for kind in one.changes.lights]
        for changes in (*one.picture.parts(), *by_light, *with_light, one.changes, *one.also):
            if not changes:
                continue
            same = [whose for other, whose in found if other == changes]
            if not same:
                found.append((changes, [one.whose]))
            elif one.whose not in same[0]:
                same[0].append(one.whose)
    return {", ".join(changes.words()): (changes, whose) for changes, whose in found}


LEFT_IN = _all()
HEIGHT_SPANNED = "the angle of view spans the height"


def canvas(p: FloatArray) -> FloatArray:
    """As a browser's canvas has it (IEC 61966-2-1), without its rounding."""
    return np.where(p <= 0.0031308, 12.92 * p, 1.055 * p ** (1.0 / 2.4) - 0.055)


def blurred(p: FloatArray, weights: FloatArray) -> FloatArray:
    """By a filter, a product of weights of whole pixels."""
    for axis in (0, 1):
        n = len(weights) // 2
        wide = np.pad(p, [(n, n) if k == axis else (0, 0) for k in range(3)], mode="edge")
        parts = np.lib.stride_tricks.sliding_window_view(wide, len(weights), axis=axis)
        p = parts @ (weights / weights.sum())
    return p


AT = np.arange(-2, 3)
BLACKMAN_HARRIS = np.where(
    np.abs(AT) < 1.5,
    0.35875
    + 0.48829 * np.cos(2.0 * np.pi * AT / 3.0)
    + 0.14128 * np.cos(4.0 * np.pi * AT / 3.0)
    + 0.01168 * np.cos(6.0 * np.pi * AT / 3.0),
    0.0,
)
"""Blender's: 1.5 pixels to either side."""

BY_DIAGNOSIS = {
    "values of a canvas (three.js, Babylon.js)": (canvas, "sRGB"),
    "files with a gamma of 2.2 (POV-Ray)": (lambda p: p ** (1.0 / 2.2), "gamma"),
    "frames by column and row (raysect)": (lambda p: p.transpose(1, 0, 2), "rows and columns"),
    "a Gaussian of half a pixel (Mitsuba)": (lambda p: blurred(p, np.exp(-2.0 * AT**2)), "blurred"),
    "Blackman and Harris' filter (Cycles)": (lambda p: blurred(p, BLACKMAN_HARRIS), "blurred"),
    "samples of lamps that are added up (Mitsuba)": (lambda p: 4.0 * p, "gain of 4"),
    "BGR in place of RGB (OpenCV)": (lambda p: p[..., ::-1], "channels"),
}


@pytest.mark.cases(2)
@pytest.mark.parametrize("which", BY_DIAGNOSIS)
def test_those_of_no_renderer_alone_are_named_by_what_they_are(which: str) -> None:
    change, words = BY_DIAGNOSIS[which]
    scene = described({"point": 1.0}, film=(32, 32))
    picture = np.ascontiguousarray(change(render(scene).colour))
    found = cause(scene, picture)
    assert words in found.name, found.name


@pytest.mark.parametrize(("where", "factor"), [("eye", 1.5**-2), ("lamp", 1.5**2)])
def test_the_square_of_the_index_is_named(where: str, factor: float) -> None:
    """An eye, or a lamp, in a ball of glass."""
    eye, lamp, sky = (0, 9, "{type: constant, radiance: [0.5, 1, 2]}")
    if where == "lamp":
        eye, lamp, sky = 4, 0, ""
    scene = Scene.parse(f"""
camera: {{type: perspective, eye: [0, 0, {eye}], target: [0.3, 0.1, -1], fov: 50}}
film: {{width: 12, height: 10}}
sampler: {{type: grid, spp: 1}}
integrator: {{type: whitted, max_depth: 6}}
materials:
  glass: {{type: dielectric, interior_ior: 1.5}}
  shining: {{type: emissive, radiance: [1, 2, 3]}}
shapes:
  - {{type: sphere, center: [0.2, 0, 0], radius: 1, material: glass}}
  - {{type: sphere, center: [0.2, 0, {lamp}], radius: 0.4, material: shining}}
lights: [{sky}]
""")
    named = [one.whose for one in RENDERERS.values() if one.glass is False]
    found = cause(scene, render(scene).colour * factor)
    assert found.name == f"radiance without 1/eta² in glass, as {', '.join(named)}"
    assert where in found.evidence


def test_files_of_eight_linear_bits_are_said() -> None:
    """Such as tachyon's by default: they are refused, with that reason."""
    scene = described({"point": 1.0})
    codes = (render(scene).colour * 255.0).astype(np.uint8) / 255.0
    case = gated(Request(scene=scene), [Picture(codes)])
    assert case.verdict == "invalid"
    assert "8-bit linear codes" in case.reason


def test_there_are_thirty() -> None:
    assert len(LEFT_IN) + len(BY_DIAGNOSIS) + 3 >= 30


@pytest.mark.cases(4)
@pytest.mark.parametrize("which", LEFT_IN)
def test_each_is_named(which: str) -> None:
    changes, whose = LEFT_IN[which]
    scene, picture = planted(changes, list(changes.lights) or ["point"])
    found = cause(scene, picture)
    if changes.fov == "larger":  # of a tall picture that is the height
        which, others = which.replace("longer side", "height"), LEFT_IN[HEIGHT_SPANNED][1]
        whose = [one.whose for one in RENDERERS.values() if one.whose in (*whose, *others)]
    assert found.name == f"{which}, as {' and '.join(whose)}"
    assert found.explained > 0.5  # a shift is interpolated, and the picture is small

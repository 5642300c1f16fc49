"""A random scene: a function of a seed and a number."""

import json
import warnings
from pathlib import Path

import numpy as np

from comparisons.experiments.fuzz import parts
from comparisons.experiments.fuzz.assemble import Assembly
from comparisons.experiments.fuzz.data import Data, text_of
from comparisons.experiments.fuzz.effort import Grammar
from comparisons.experiments.fuzz.fields import Draw, rounded
from comparisons.experiments.fuzz.types import GROUPS, kind_of
from reference_rt.integrators import RayCast
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import SceneWarning


def generate(seed: int, number: int, grammar: Grammar, folder: Path) -> Data:
    """The scene's data;  folder: of the files that it names (`assets.write`)."""
    draw = Draw(np.random.default_rng([seed, number]), grammar.extreme)
    found = Assembly(draw, _wanted(draw, grammar.features), folder).data()
    if draw.extreme and draw.chance(0.4):
        found = _far(draw, found)
    for _ in range(MENDED):
        if _shows_light(found, folder):
            break
        found = _mended(draw, found)
    return found


MENDED = 3
"""Times that a scene whose picture is black is seen from another place."""


def _shows_light(data: Data, folder: Path) -> bool:
    """Whether a small picture is not black; a scene that cannot be rendered is left as it is, to be
    found."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SceneWarning)
            scene = parse(data, "small", folder)
            if isinstance(scene.integrator, RayCast):
                return True
            return bool(render(scene, size=(8, 6), spp=4, threads=1).colour.any())
    except Exception:
        return True


def _mended(draw: Draw, data: Data) -> Data:
    """The scene seen from another side, with a light where the camera is."""
    camera = data["camera"]
    far = float(np.linalg.norm(np.subtract(camera["eye"], camera["target"])))
    toward = far * parts.direction(draw, 0.0)
    eye = [rounded(x) for x in (np.array(camera["target"]) + toward).tolist()]
    camera = camera | {"eye": eye, "up": [0.1, 1.0, 0.2]}
    lamp = {"type": "point", "position": eye, "intensity": rounded(0.6 * far * far)}
    kept = [x for x in data.get("lights", ()) if x.get("position") != data["camera"]["eye"]]
    return data | {"camera": camera, "lights": [*kept, lamp]}


def parse(data: Data, number: int | str, folder: Path) -> Scene:
    """The scene, through its text.  Raises SceneError."""
    return Scene.parse(text_of(data), f"{number}.yaml", folder)


def _wanted(draw: Draw, features: tuple[str, ...]) -> dict[str, list[str]]:
    """The types that the scene must have, by kind; of a group one type."""
    found: dict[str, list[str]] = {}
    for name in features:
        one = draw.pick(GROUPS[name]) if name in GROUPS else name
        found.setdefault(kind_of(one), []).append(one)
    return found


def _far(draw: Draw, scene: Data) -> Data:
    """The scene, far from the origin or of another size; a camera's lengths too."""
    from comparisons.geometry.frame import Frame
    from comparisons.mitsuba.translate.moved import moved

    size = 2.0 ** int(draw.rng.integers(-12, 13))
    center = (0.0, 0.0, 0.0)
    if draw.chance(0.5):
        far = draw.pick((10.0, 100.0, 1e3, 1e4))
        x, y, z = (rounded(far * x) for x in parts.direction(draw).tolist())
        center = (x, y, z)
    there = moved(Scene.model_validate(scene), Frame(center, size))
    found: Data = json.loads(there.to_json())
    return found

"""The example scenes of scene_reference.md, and their pictures: see reference_examples.yaml."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml
from docs_pages import DOCS, save

from reference_rt import Picture, Scene, Sobol, render
from reference_rt.rendering.image import display

PICTURES = DOCS / "pictures" / "reference"
SCENES = DOCS.parent / "scenes"
WIDTH, HEIGHT = 240, 180
SAMPLES = 128
"""Samples per pixel where an example does not say."""

_FILE = yaml.safe_load((DOCS / "reference_examples.yaml").read_text("utf-8"))
EXAMPLES: dict[str, Any] = _FILE["examples"]
"""By the name of the type's class."""
VALUES: dict[str, Any] = _FILE["values"]
"""By class and field."""
VALUE_SIZE = 120, 90


def scene_of(name: str) -> Scene:
    """The scene of a type's example: the base with the example's parts."""
    return _scene(EXAMPLES[name], name, (WIDTH, HEIGHT))


def scene_of_value(field: str, value: str) -> Scene:
    """The scene of a value of a field, such as Bitmap.wrap and clamp."""
    example = VALUES[field]
    text = example.get("own", {}).get(value, example["yaml"])
    example = example | {"yaml": text.replace("VALUE", value)}
    if "layer" in example:
        example["layers"] = (example["layer"].replace("VALUE", value),)
    return _scene(example, f"{field}: {value}", VALUE_SIZE)


def _scene(example: Mapping[str, Any], name: str, size: tuple[int, int]) -> Scene:
    shown = yaml.safe_load(example["yaml"])
    data = merged(_FILE["bases"][example["in"]], shown)
    scene = Scene.parse(yaml.safe_dump(data), f"{name} of reference_examples.yaml", SCENES)
    times = example.get("pixels", 1)
    width, height = (side // times for side in size)
    layers = example.get("layers", ())
    film = scene.film.model_copy(update={"width": width, "height": height, "layers": layers})
    scene = scene.changed(film=film)
    if "sampler" not in shown and not scene.integrator.deterministic:
        scene = scene.changed(sampler=Sobol(spp=example.get("spp", SAMPLES)))
    return scene


def merged(base: Mapping[str, Any], parts: Mapping[str, Any]) -> dict[str, Any]:
    """The base with the parts: lists are joined, names are added, everything else is replaced."""
    found = dict(base)
    for key, value in parts.items():
        if isinstance(value, list):
            found[key] = [*base.get(key, ()), *value]
        elif key in ("textures", "materials", "media", "groups"):
            found[key] = {**base.get(key, {}), **value}
        else:
            found[key] = value
    return found


def picture_of_value(field: str, value: str) -> None:
    picture = render(scene_of_value(field, value))
    if layers := picture.scene.film.layers:
        picture = replace(picture, shown=layers[0])
    save(PICTURES / "values" / f"{field}.{value}.jpg", _bytes(picture))
    print(field, value, flush=True)


def _bytes(picture: Picture) -> npt.NDArray[np.uint8]:
    return np.round(255.0 * np.clip(display(picture), 0.0, 1.0)).astype(np.uint8)


def picture_of(name: str) -> None:
    values = _bytes(render(scene_of(name)))
    times = EXAMPLES[name].get("pixels", 1)
    save(PICTURES / f"{name}.jpg", values.repeat(times, axis=0).repeat(times, axis=1))
    print(name, flush=True)

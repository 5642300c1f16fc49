"""The example scenes of scene_reference.md, and their pictures: see reference_examples.yaml."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import yaml
from docs_pages import DOCS, save

from reference_rt import Scene, Sobol, render
from reference_rt.rendering.image import display

PICTURES = DOCS / "pictures" / "reference"
SCENES = DOCS.parent / "scenes"
WIDTH, HEIGHT = 240, 180
SAMPLES = 128
"""Samples per pixel where an example does not say."""

_FILE = yaml.safe_load((DOCS / "reference_examples.yaml").read_text("utf-8"))
EXAMPLES: dict[str, Any] = _FILE["examples"]
"""By the name of the type's class."""


def scene_of(name: str) -> Scene:
    """The scene of a type's example: the base with the example's parts."""
    example = EXAMPLES[name]
    shown = yaml.safe_load(example["yaml"])
    data = merged(_FILE["bases"][example["in"]], shown)
    scene = Scene.parse(yaml.safe_dump(data), f"{name} of reference_examples.yaml", SCENES)
    times = example.get("pixels", 1)
    film = scene.film.model_copy(
        update={"width": WIDTH // times, "height": HEIGHT // times, "layers": ()}
    )
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


def picture_of(name: str) -> None:
    values = np.round(255.0 * np.clip(display(render(scene_of(name))), 0.0, 1.0)).astype(np.uint8)
    times = EXAMPLES[name].get("pixels", 1)
    save(PICTURES / f"{name}.jpg", values.repeat(times, axis=0).repeat(times, axis=1))
    print(name, flush=True)

"""Scene files by another YAML reader, which knows nothing of our types: each value of a file is in
its place of the scene.  (What a file leaves out is `docs/scene_reference.md`'s to say.)"""

import pytest
from builders import SCENES
from ruamel.yaml import YAML

from reference_rt.rendering.scene import Scene


def differences(text, scene, where):
    """Places where the scene is not what the text says;  one number may stand for a few."""
    if isinstance(text, dict) and isinstance(scene, dict):
        for key, value in text.items():
            yield from differences(value, scene.get(key, "nothing"), f"{where}.{key}")
    elif isinstance(text, list) and isinstance(scene, list):
        more = [0.0] if ".rings[" in where and len(text) == 2 else []  # points of the plane z = 0
        if len(text + more) != len(scene):
            yield where
        for k, values in enumerate(zip(text + more, scene, strict=False)):
            yield from differences(*values, f"{where}[{k}]")
    elif text != scene and not (isinstance(scene, list) and {*scene} == {text}):
        yield where


@pytest.mark.filterwarnings("ignore")
def test_every_value_of_every_scene():
    read = {
        path.name: list(
            differences(
                YAML(typ="safe", pure=True).load(path), Scene.load(path).model_dump(mode="json"), ""
            )
        )
        for path in sorted(SCENES.rglob("*.yaml"))
    }
    assert len(read) > 70
    assert {name: found for name, found in read.items() if found} == {}

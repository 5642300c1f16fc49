"""Random scenes, generated from the JSON Schema of scenes."""

from functools import cache
from typing import Any

import numpy as np

from comparisons.experiments.stability.hostile.bases import COPIES, IMAGES, MESHES
from comparisons.experiments.stability.hostile.damage import anything, number, pick
from reference_rt.scene.model import json_schema

NAMES: tuple[str, ...] = ("a", "b", "c")
"""Of materials, textures and groups: few, so that they are found, and contain each other."""

_CIRCLES = 0.05
"""The chance that one may contain itself."""

DEEPEST = 7
"""Levels below which everything optional is left out."""

_OPTIONAL = 0.3
"""The chance that a key is there that need not be."""


@cache
def _schema() -> dict[str, Any]:
    return json_schema()


def sentence(rng: np.random.Generator, share: float) -> Any:
    """A scene in which each value is hostile with the chance `share`."""
    root = _schema()["properties"]
    writer = _Writer(rng, share)
    scene: dict[str, Any] = {}
    for name in ("textures", "materials", "groups"):
        scene[name] = {}
        for k, key in enumerate(NAMES):
            # Each is made of later ones, but for a few.
            later = NAMES[k + 1 :] if rng.random() > _CIRCLES else NAMES
            writer.names = later or NAMES
            depth = 1 if later else DEEPEST - 2
            scene[name][key] = writer.value(root[name]["additionalProperties"], depth)
    writer.names = NAMES
    scene["shapes"] = [writer.value(root["shapes"]["items"], 1) for _ in range(rng.integers(1, 6))]
    scene["lights"] = [writer.value(root["lights"]["items"], 1) for _ in range(rng.integers(0, 3))]
    for name in ("camera", "integrator", "film", "sampler"):
        if rng.random() < _OPTIONAL:
            scene[name] = writer.value(root[name], 1)
    for name in ("textures", "materials", "groups"):
        if rng.random() < share:
            del scene[name]  # which others name
    return scene


class _Writer:
    def __init__(self, rng: np.random.Generator, share: float) -> None:
        self.rng, self.share, self.names = rng, share, NAMES

    def value(self, schema: dict[str, Any], depth: int, key: str = "") -> Any:
        if self.rng.random() < self.share * 0.3:
            return anything(self.rng)
        if "$ref" in schema:
            return self.value(_schema()["$defs"][schema["$ref"].rsplit("/", 1)[1]], depth, key)
        for choice in ("oneOf", "anyOf"):
            if choice in schema:
                return self.value(self._chosen(schema[choice], depth), depth, key)
        if "const" in schema:
            return schema["const"]
        if "enum" in schema:
            return pick(self.rng, schema["enum"])
        kind = schema.get("type", "null")
        known = key in _RANGES.get(kind, {}) and schema.get("maxItems") != 2
        if known and self.rng.random() > self.share:
            return np.asarray(self.rng.uniform(*_RANGES[kind][key])).tolist()
        return getattr(self, "_" + kind)(schema, depth, key)

    def _chosen(self, choices: list[dict[str, Any]], depth: int) -> dict[str, Any]:
        """One of them; far down, none that goes further down.  Never rough plastic: plain Python
        takes 10 s to make its tables; `bases.LAYERS` has it."""
        flat = [c for c in choices if not str(c.get("$ref", "")).endswith("/RoughPlastic")]
        if depth > DEEPEST - 3:
            shallow = [c for c in flat if not str(c.get("$ref", "")).endswith(_DEEP)]
            flat = shallow or flat
        return pick(self.rng, flat)  # type: ignore[no-any-return]

    def _object(self, schema: dict[str, Any], depth: int, _: str) -> Any:
        needed = schema.get("required", [])
        found: dict[str, Any] = {}
        for key, part in schema.get("properties", {}).items():
            if key in _FROM_MEMORY and "file" in found:
                continue
            own_file = key == "file" and schema["title"] != "Instance"
            optional = key not in needed and key != "type" and not own_file
            if optional and (depth > DEEPEST or self.rng.random() > _OPTIONAL):
                continue
            if key in _WITH and _WITH[key] not in found:
                continue
            name = schema["title"] + key if key == "file" else key
            found[key] = self.value(part, depth + 1, name)
        return found

    def _array(self, schema: dict[str, Any], depth: int, _: str) -> Any:
        least = int(schema.get("minItems", 0))
        most = int(schema.get("maxItems", least + 2))
        if "prefixItems" in schema:
            return [self.value(part, depth + 1) for part in schema["prefixItems"]]
        count = int(self.rng.integers(least, most + 1))
        return [self.value(schema.get("items", _NUMBER), depth + 1) for _ in range(count)]

    def _number(self, schema: dict[str, Any], _: int, __: str) -> Any:
        if self.rng.random() < self.share:
            return number(self.rng, 1.0)
        low = schema.get("minimum", schema.get("exclusiveMinimum", -2.0))
        high = schema.get("maximum", schema.get("exclusiveMaximum", max(low + 2.0, 2.0)))
        return float(self.rng.uniform(low, high))

    def _integer(self, schema: dict[str, Any], _: int, __: str) -> Any:
        if self.rng.random() < self.share:
            return number(self.rng, 1)
        low = int(schema.get("minimum", 0))
        return int(self.rng.integers(low, low + 5))

    def _string(self, _: dict[str, Any], __: int, key: str) -> Any:
        if self.rng.random() < self.share:
            return anything(self.rng)
        if key.endswith("file"):
            return pick(self.rng, {"Meshfile": MESHES, "Instancefile": (COPIES,)}.get(key, IMAGES))
        return pick(self.rng, self.names)

    def _boolean(self, _: dict[str, Any], __: int, ___: str) -> Any:
        return bool(self.rng.random() < 0.5)

    def _null(self, _: dict[str, Any], __: int, ___: str) -> Any:
        return None


_CORNERS = [-1.0, 0.1, -1.0, 0.1], [-0.1, 1.0, -0.1, 1.0]

_RANGES: dict[str, dict[str, Any]] = {
    "array": {
        "lower": (-2.0, 0.0, 3),
        "upper": (0.0, 2.0, 3),
        "matrix": (-1.0, 1.0, (3, 4)),
        "rings": (-1.0, 1.0, (2, 4, 2)),
        "scale": (0.5, 2.0, 3),
        "view": _CORNERS,
    },
    "number": {"z_min": (-1.0, 0.0), "z_max": (1.0, 2.0)},
}
"""What the schema does not say all of, by its kind, as arguments of `uniform`."""

_WITH = {"distance": "view"}
"""Keys that another one must be there for."""

_FROM_MEMORY = ("vertices", "faces", "normals", "uv", "colours")
"""Keys of a mesh without a file: numbers drawn by themselves make none."""

_NUMBER = {"type": "number"}
_DEEP = (
    "/Union", "/Intersection", "/Difference", "/Instance",
    "/Mask", "/Blend", "/Bump", "/NormalMap", "/TwoSided",
)  # fmt: skip
"""What is made of others."""

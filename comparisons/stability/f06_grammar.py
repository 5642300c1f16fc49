"""Scenes that nobody wrote: sentences of the JSON Schema of scenes."""

from functools import cache
from typing import Any

import numpy as np

from comparisons.stability.f06_bases import IMAGES, MESHES
from comparisons.stability.f06_damage import anything, number, pick
from reference_rt.scene import json_schema

NAMES = ("a", "b", "c")
"""Of materials, textures and groups: few, so that they are found, and contain each other."""

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
    scene: dict[str, Any] = {
        name: {key: writer.value(root[name]["additionalProperties"], 1) for key in NAMES[:2]}
        for name in ("textures", "materials", "groups")
    }
    scene["shapes"] = [writer.value(root["shapes"]["items"], 1) for _ in range(rng.integers(1, 6))]
    scene["lights"] = [writer.value(root["lights"]["items"], 1) for _ in range(rng.integers(0, 3))]
    for name in ("camera", "integrator", "film", "sampler"):
        if rng.random() < _OPTIONAL:
            scene[name] = writer.value(root[name], 1)
    for name in ("textures", "materials", "groups"):
        if rng.random() < _OPTIONAL:
            del scene[name]
    return scene


class _Writer:
    def __init__(self, rng: np.random.Generator, share: float) -> None:
        self.rng, self.share = rng, share

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
        if key in _SHAPES_OF and self.rng.random() > self.share:
            return self.rng.uniform(*_SHAPES_OF[key]).tolist()
        write = getattr(self, "_" + schema.get("type", "null"))
        return write(schema, depth, key)

    def _chosen(self, choices: list[dict[str, Any]], depth: int) -> dict[str, Any]:
        """One of them; far down, none that goes further down."""
        flat = [c for c in choices if "of" not in str(c.get("$ref", ""))]
        if depth > DEEPEST - 3:
            shallow = [c for c in flat if not str(c.get("$ref", "")).endswith(_DEEP)]
            flat = shallow or flat
        return pick(self.rng, flat)  # type: ignore[no-any-return]

    def _object(self, schema: dict[str, Any], depth: int, _: str) -> Any:
        needed = schema.get("required", [])
        found: dict[str, Any] = {}
        for key, part in schema.get("properties", {}).items():
            optional = key not in needed and key != "type"
            if (
                optional
                and key not in _SHAPES_OF
                and (depth > DEEPEST or self.rng.random() > _OPTIONAL)
            ):
                continue
            found[key] = self.value(part, depth + 1, key)
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
        if key == "file":
            return pick(self.rng, MESHES + IMAGES)
        return pick(self.rng, NAMES)

    def _boolean(self, _: dict[str, Any], __: int, ___: str) -> Any:
        return bool(self.rng.random() < 0.5)

    def _null(self, _: dict[str, Any], __: int, ___: str) -> Any:
        return None


_SHAPES_OF: dict[str, Any] = {
    "lower": (-2.0, 0.0, 3),
    "upper": (0.0, 2.0, 3),
    "matrix": (-1.0, 1.0, (3, 4)),
    "rings": (-1.0, 1.0, (2, 4, 2)),
    "scale": (0.5, 2.0, 3),
}
"""Arrays of which the schema does not say all, as arguments of `uniform`."""

_NUMBER = {"type": "number"}
_DEEP = ("/Union", "/Intersection", "/Difference", "/Instance")

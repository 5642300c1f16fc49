"""Random values for the fields of a description, from its JSON Schema."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from comparisons.experiments.fuzz.data import Data
from comparisons.experiments.fuzz.schema import name_of
from reference_rt.core.model import Description

DIGITS = 3
"""Significant digits of random numbers: findings stay readable."""


@dataclass
class Names:
    """What fields may name.  textures: for colours and numbers;  factors: for products;  images:
    for slopes;  normals: for normals;  files: by type, such as "bitmap"."""

    factors: list[str] = field(default_factory=list)
    textures: list[str] = field(default_factory=list)
    images: list[str] = field(default_factory=list)
    normals: list[str] = field(default_factory=list)
    groups: list[str] = field(default_factory=list)
    files: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass
class Draw:
    """rng: the scene's random numbers;  extreme: far, tiny and thin values too."""

    rng: np.random.Generator
    extreme: bool = False

    def chance(self, p: float) -> bool:
        """True with the probability p."""
        return bool(self.rng.random() < p)

    def pick(self, items: Any) -> Any:
        """One item of a sequence."""
        return items[int(self.rng.integers(len(items)))]

    def between(self, low: float, high: float) -> float:
        """Uniform, of DIGITS digits."""
        return rounded(float(self.rng.uniform(low, high)))

    def log(self, low: float, high: float) -> float:
        """Uniform in the logarithm."""
        return rounded(math.exp(float(self.rng.uniform(math.log(low), math.log(high)))))

    def vector(self, reach: float = 1.0) -> list[float]:
        """Three numbers within `reach`."""
        return [self.between(-reach, reach) for _ in range(3)]


def rounded(x: float) -> float:
    """x with DIGITS digits."""
    return float(f"{x:.{DIGITS}g}")


def values(cls: type[Description], draw: Draw, names: Names) -> Data:
    """The fields of a description but those that name materials and media, which the caller adds.

    A required field is always there, any other one half the time.
    """
    own = name_of(cls)
    special = SPECIAL.get(own)
    if special is not None:
        return {"type": own, **special(draw)}
    schema = _schema(cls)
    named = ("base", "material", "transform", "interior", "exterior", "medium")
    bases = (*getattr(cls, "bases", ()), *named)
    found: Data = {"type": own} if "type" in schema["properties"] else {}
    for key, part in schema["properties"].items():
        if key == "type" or key in bases:
            continue
        if key not in schema.get("required", ()) and draw.chance(0.5):
            continue
        value = _value(part, draw, names, own, key, schema)
        if value is not None:
            found[key] = value
    return found


@cache
def _schema(cls: type[Description]) -> dict[str, Any]:
    return cls.model_json_schema(by_alias=True)


def _value(
    part: dict[str, Any], draw: Draw, names: Names, own: str, key: str, root: dict[str, Any]
) -> Any:
    """A value that the schema allows; None to leave the field out."""
    known = RANGES.get(f"{own}.{key}") or RANGES.get(key)
    if "$ref" in part:
        return _object(root["$defs"][part["$ref"].rsplit("/", 1)[1]], draw, names, key, root)
    if "anyOf" in part:
        return _any_of(part["anyOf"], draw, names, own, key, root)
    if known is not None and part.get("type") in ("number", "integer", "string"):
        return known(draw)
    match part.get("type"):
        case "number":
            return _number(part, draw)
        case "integer":
            low = part.get("minimum", 0)
            return int(draw.rng.integers(low, min(low + 4, part.get("maximum", low + 4)) + 1))
        case "boolean":
            return draw.chance(0.5)
        case "string":
            return _word(part, draw, names, own, key)
        case "array":
            return _array(part, draw, names, own, key, root)
    return None


def _any_of(
    parts: list[dict[str, Any]], draw: Draw, names: Names, own: str, key: str, root: dict[str, Any]
) -> Any:
    textured = [p for p in parts if p.get("description") == "the name of a texture"]
    if textured and names.textures and draw.chance(0.4):
        return draw.pick(names.textures)
    left = [p for p in parts if p.get("type") != "null" and p not in textured]
    return _value(draw.pick(left), draw, names, own, key, root)


def _object(part: dict[str, Any], draw: Draw, names: Names, own: str, root: dict[str, Any]) -> Data:
    found = {}
    for key, inner in part["properties"].items():
        if key in part.get("required", ()) or draw.chance(0.5):
            value = _value(inner, draw, names, own, key, root)
            if value is not None:
                found[key] = value
    return found


def _number(part: dict[str, Any], draw: Draw) -> float:
    low = part.get("minimum", part.get("exclusiveMinimum"))
    high = part.get("maximum", part.get("exclusiveMaximum"))
    if low is None and high is None:
        return draw.between(-1.0, 1.0)
    if low is not None and high is not None:
        open_ends = part.get("exclusiveMinimum"), part.get("exclusiveMaximum")
        while (
            x := draw.between(low, high) if high <= 1000.0 else draw.log(0.1, 10.0)
        ) in open_ends:
            pass  # rounded to a bound that does not belong to the range
        return x
    if low == 0:
        return draw.log(0.3, 2.0)
    return draw.between(-1.0 if low is None else low, 1.0 if high is None else high)


def _array(
    part: dict[str, Any], draw: Draw, names: Names, own: str, key: str, root: dict[str, Any]
) -> Any:
    known = RANGES.get(f"{own}.{key}") or RANGES.get(key)
    count = part.get("maxItems", int(draw.rng.integers(1, 4)))
    if key == "of":
        return [draw.pick(names.factors) for _ in range(count)]
    if part.get("minItems") != part.get("maxItems") or "items" not in part:
        return None
    if known is not None:
        return [known(draw) for _ in range(count)]
    return [_value(part["items"], draw, names, own, "", root) for _ in range(count)]


def _word(part: dict[str, Any], draw: Draw, names: Names, own: str, key: str) -> Any:
    if "enum" in part:
        return draw.pick(part["enum"])
    if key == "file":
        return draw.pick(names.files[own]) if own in names.files else None
    if key == "layer":  # files here have no layers
        return None
    if key == "group":
        return draw.pick(names.groups) if names.groups else None
    images = names.normals if key == "normals" and not draw.extreme else names.images
    return draw.pick(images) if images else None


# ---- where the schema's range is wider than what scenes have -------------------------------------


def _ior(draw: Draw) -> float:
    if draw.extreme and draw.chance(0.3):
        return float(draw.pick((1.0001, 1.000001, 5.0, 0.2)))
    return draw.between(1.05, 2.2)


def _alpha(draw: Draw) -> float:
    return draw.log(1e-4, 1e-2) if draw.extreme and draw.chance(0.4) else draw.log(0.05, 0.8)


def _light(draw: Draw) -> float:
    return draw.log(0.5, 6.0)


RANGES: dict[str, Callable[[Draw], Any]] = {
    # `radiance` is for .hdr alone, and no drawn file is one.
    "bitmap.encoding": lambda draw: draw.pick(("auto", "srgb", "raw")),
    "environment_map.encoding": lambda _draw: "auto",
    "interior_ior": _ior,
    "exterior_ior": lambda draw: draw.pick((1.0, 1.0, 1.33, 1.1)),
    "principled.eta": _ior,
    "eta": lambda draw: draw.log(0.1, 3.0),
    "k": lambda draw: draw.log(0.5, 5.0),
    "alpha": _alpha,
    "phong.ambient": lambda draw: draw.between(0.0, 0.3),
    "phong.diffuse": lambda draw: draw.between(0.1, 0.4),
    "phong.specular": lambda draw: draw.between(0.0, 0.3),
    "phong.mirror": lambda draw: draw.between(0.0, 0.25),
    "exponent": lambda draw: draw.log(2.0, 200.0),
    "radiance": _light,
    "constant.radiance": lambda draw: draw.log(0.1, 1.0),
    "ambient.radiance": lambda draw: draw.log(0.05, 0.3),
    "irradiance": lambda draw: draw.log(0.5, 3.0),
    "projector.irradiance": lambda draw: draw.log(10.0, 60.0),
    "intensity": lambda draw: draw.log(10.0, 60.0),
    "cutoff_angle": lambda draw: draw.between(25.0, 80.0),
    "beam_width": lambda draw: draw.between(5.0, 19.9),
    "rotate": lambda draw: draw.between(-180.0, 180.0),
    "uv_set": lambda _draw: 0,  # not all shapes of a material have another
    "uv.scale": lambda draw: draw.pick((0.5, 1.0, 2.0, 5.0, -1.0)),
    "bump.scale": lambda draw: draw.between(0.02, 0.3),
    "bitmap.scale": lambda draw: draw.pick((1.0, 0.5, 1.0)),
    "bitmap.cutoff": lambda draw: draw.between(0.1, 0.9),
    "normal_map.scale": lambda draw: draw.between(0.3, 1.5),
    "vertex_colours.scale": lambda draw: draw.pick((1.0, 0.5)),
    "factor": lambda draw: draw.between(0.2, 1.0),
    "environment_map.scale": lambda draw: draw.log(0.3, 2.0),
    "first": lambda draw: draw.between(0.05, 0.95),
    "second": lambda draw: draw.between(0.05, 0.95),
    "without": lambda draw: draw.between(0.05, 0.95),
    "spp": lambda draw: draw.pick((1, 4, 9, 16)),
    "seed": lambda draw: int(draw.rng.integers(0, 1000)),
    "path.max_depth": lambda draw: draw.pick((1, 2, 3, 4, 6, 10)),
    "whitted.max_depth": lambda draw: draw.pick((1, 2, 3, 4, 6)),
    "min_contribution": lambda draw: draw.pick((0.0, 1e-4, 1e-3)),
    "light_samples": lambda draw: draw.pick((1, 1, 2)),
    "bsdf_samples": lambda draw: draw.pick((0, 1, 2)),
    "lobes": lambda draw: draw.pick((1, 2, 3, 4)),
    "stddev": lambda draw: draw.between(0.3, 0.8),
    "tent.radius": lambda draw: draw.pick((0.5, 1.0, 1.5)),
}
"""Random numbers for a field, by "type.field" or by the field of any type."""


def _triangle(draw: Draw) -> Data:
    a = [draw.vector() for _ in range(3)]
    if draw.extreme and draw.chance(0.3):
        a[2] = [rounded(x + 1e-3 * y) for x, y in zip(a[1], draw.vector(), strict=True)]
    return {"v0": a[0], "v1": a[1], "v2": a[2]}


def _polygon(draw: Draw) -> Data:
    """A star-shaped or crossed outline, perhaps with a hole."""
    count = int(draw.rng.integers(3, 9))
    angles = np.sort(draw.rng.uniform(0.0, 2.0 * np.pi, count))
    if draw.chance(0.3):
        draw.rng.shuffle(angles)
    radii = draw.rng.uniform(0.4, 1.0, count)
    xs = (rounded(r * math.cos(a)) for r, a in zip(radii, angles, strict=True))
    ys = (rounded(r * math.sin(a)) for r, a in zip(radii, angles, strict=True))
    rings = [[[x, y] for x, y in zip(xs, ys, strict=True)]]
    if draw.chance(0.4):
        rings.append([[-0.2, -0.1], [0.25, -0.1], [0.0, 0.3]])
    found: Data = {"rings": rings}
    return found | ({"fill": draw.pick(("even_odd", "nonzero"))} if draw.chance(0.5) else {})


def _cylinder(draw: Draw) -> Data:
    low, size = draw.between(-1.0, 0.0), draw.between(0.3, 1.5)
    found: Data = {"z_min": low, "z_max": rounded(low + size)}
    found |= {"radius": draw.between(0.3, 1.0)} if draw.chance(0.7) else {}
    return found | ({"capped": draw.chance(0.5)} if draw.chance(0.5) else {})


def _torus(draw: Draw) -> Data:
    major = draw.between(0.5, 1.0)
    return {"major_radius": major, "minor_radius": rounded(major * draw.between(0.1, 0.9))}


def _quadric(draw: Draw) -> Data:
    """An ellipsoid, hyperboloid or paraboloid, or any other form, in a box about the origin."""
    a, b, c = (draw.log(0.6, 3.0) for _ in range(3))
    form = draw.pick(
        (
            [a, b, c, 0, 0, 0, 0, 0, 0, -1],
            [a, b, -c, 0, 0, 0, 0, 0, 0, -0.5],
            [a, b, -c, 0, 0, 0, 0, 0, 0, 0.2],
            [a, b, 0, 0, 0, 0, 0, 0, -1, 0],
            [a, -b, 0, 0, 0, 0, 0, 0, 1, 0],
            [a, b, 0, 0, 0, 0, 0, 0, 0, -0.6],
            None,
        )
    )
    if form is None:
        form = [draw.between(-1.0, 1.0) for _ in range(10)]
    form = [float(x) for x in form]
    if draw.chance(0.3):
        form[3:6] = [draw.between(-0.5, 0.5) for _ in range(3)]
    lower, upper = ([draw.between(0.5, 1.2) for _ in range(3)] for _ in range(2))
    found = {"coefficients": form, "lower": [-x for x in lower], "upper": upper}
    return found | ({"capped": draw.chance(0.5)} if draw.chance(0.5) else {})


def _goniometric(draw: Draw) -> Data:
    """A lamp with a table, of any symmetry; its place is given by others."""
    around = draw.pick(
        ([0], [0, 90], [0, 30, 90], [0, 60, 180], [90, 150, 200, 270], [0, 100, 200, 300, 360])
    )
    down = draw.pick(([0, 20, 50, 90], [0, 35, 70, 120, 180], [0, 10, 60]))
    values = [[draw.log(0.3, 3.0) for _ in down] for _ in around]
    for row in values:
        row[0] = values[0][0]  # one direction
    if around[-1] == 360:
        values[-1] = values[0]
    found = {"vertical_angles": down, "horizontal_angles": around, "values": values}
    return found | {"intensity": draw.log(10.0, 60.0), "c0": draw.vector()}


SPECIAL: dict[str, Callable[[Draw], Data]] = {
    "triangle": _triangle,
    "polygon": _polygon,
    "cylinder": _cylinder,
    "torus": _torus,
    "quadric": _quadric,
    "goniometric": _goniometric,
}
"""Types whose fields depend on each other in ways that few random numbers satisfy."""

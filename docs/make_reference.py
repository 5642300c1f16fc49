"""Makes docs/scene_reference.md and its pictures: `python docs/make_reference.py [NAME...]`.

Fields, ranges, defaults and descriptions are from the JSON Schema; examples are from
reference_examples.yaml.  NAME: only the pictures of these types, or of the values of these fields,
such as Bitmap.wrap; `text`: none.  The page is always written.
"""

import sys
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from docs_pages import DOCS
from reference_scenes import (
    EXAMPLES,
    PICTURES,
    VALUE_SIZE,
    WIDTH,
    picture_of,
    picture_of_value,
)

import reference_rt as rt
from reference_rt import json_schema
from reference_rt.materials import Wrapper
from reference_rt.shapes.csg import Solid
from reference_rt.util.files import replacing

PAGE = DOCS / "scene_reference.md"

LONGEST_LINE = 76
"""Characters of a line of YAML, which fit beside the contents of the page."""

SCHEMA = json_schema()
TYPES: dict[str, Any] = SCHEMA["$defs"]


def of_kind(key: str) -> list[str]:
    """The classes that a key of the scene may hold, in the schema's order."""
    found = [name for name in _targets(SCHEMA["properties"][key]) if name in TYPES]
    return list(dict.fromkeys(found))


def _targets(part: Any) -> Iterator[str]:
    """The names of all definitions that a part of the schema refers to, not those within them."""
    if isinstance(part, dict):
        if "$ref" in part:
            yield part["$ref"].rpartition("/")[2]
        for key, value in part.items():
            if key != "discriminator":
                yield from _targets(value)
    elif isinstance(part, list):
        for value in part:
            yield from _targets(value)


def sections() -> list[tuple[str, str, list[str]]]:
    """Title, text and types of each section."""
    shapes, materials = of_kind("shapes"), of_kind("materials")
    solids = [name for name in shapes if issubclass(getattr(rt, name), Solid)]
    wrappers = [name for name in materials if issubclass(getattr(rt, name), Wrapper)]
    filters = [name for name in _targets(TYPES["Film"]) if name.endswith("Filter")]
    return [
        ("Cameras", "`camera` is one of these.", of_kind("camera")),
        ("Film", "`film` is the picture.", ["Film"]),
        ("Filters", "`filter` of the film is one of these.", list(dict.fromkeys(filters))),
        ("Samplers", "`sampler` is one of these.", of_kind("sampler")),
        ("Integrators", "`integrator` is one of these.", of_kind("integrator")),
        (
            "Shapes",
            "`shapes`, and each of `groups`, is a list of these and of solids.",
            [name for name in shapes if name not in solids],
        ),
        (
            "Solids",
            "Set operations on shapes that enclose space: `sphere`, `box`, `cylinder`, `cone`, "
            "`torus`, capped quadrics, `plane`, closed meshes, and solids again.",
            solids,
        ),
        (
            "Transforms",
            "`transform` is a list of these steps, or one matrix. The first step is applied first.",
            ["Translate", "Scale", "Rotate", "Matrix"],
        ),
        (
            "Materials",
            "`materials` gives each of these a name. A parameter that may be a texture takes the "
            "name of one.",
            [name for name in materials if name not in wrappers],
        ),
        (
            "Materials made of others",
            "They name other materials, and may be nested.",
            wrappers,
        ),
        (
            "Media",
            "`media` gives each of these a name. A shape's `interior` and `exterior`, and the "
            "camera's `medium`, are such names.",
            of_kind("media"),
        ),
        (
            "Phase functions",
            "`phase` of a medium is one of these.",
            [name for name in _targets(TYPES["Homogeneous"]) if name != "Homogeneous"],
        ),
        ("Textures", "`textures` gives each of these a name.", [*of_kind("textures"), "UvMap"]),
        (
            "Lights",
            "`lights` is a list of these. A shape with an `emissive` material is a light, too.",
            of_kind("lights"),
        ),
    ]


SECTIONS = sections()
SIDE_BY_SIDE = {"Filters", "Samplers", "Integrators"}
"""Sections that begin with the pictures of all their types: these are of one scene each."""
LISTED = {name for _, _, names in SECTIONS for name in names}
"""The types that have a heading."""


# ---- the page -----------------------------------------------------------------------------------


def page() -> str:
    """The page as Markdown."""
    lines = [
        "# Scene reference",
        "",
        "Every type and every field of scene files, from the JSON Schema that",
        "`reference-rt schema` prints. [Scene files](scenes.md) is the overview. Each example",
        "shows what is put into a scene. `python docs/make_reference.py` writes this page.",
        "",
        "Colours are linear sRGB: one number, or three. Vectors are `[x, y, z]`. File names are",
        "relative to the scene file. A field without a default is required.",
        "",
        "## The scene",
        "",
        *table(SCHEMA, ()),
        *strips("Scene"),
    ]
    for title, text, names in SECTIONS:
        lines += ["", f"## {title}", "", text]
        if title in SIDE_BY_SIDE:
            lines += strip({word(name): f"{name}.jpg" for name in names})
        shared = shared_fields(names)
        if shared:
            lines += ["", "All of them have these fields:", ""]
            lines += table(TYPES[names[0]], (), only=shared)
        for name in names:
            lines += entry(name, shared)
    return "\n".join(lines) + "\n"


def wrapped(text: str) -> list[str]:
    """Lines of YAML; those that are too long are continued below their first brace, where line
    breaks mean nothing."""
    found = []
    for whole in text.rstrip().splitlines():
        line, indent = whole, " " * (whole.find("{") + 1)
        while len(line) > LONGEST_LINE and ", " in line[len(indent) : LONGEST_LINE]:
            # The last place that is inside of the fewest brackets.
            places = [k for k in range(len(indent), LONGEST_LINE) if line.startswith(", ", k)]
            end = min(places, key=lambda k: (_depth(line[:k]), -k)) + 1
            found.append(line[:end])
            line = indent + line[end:].lstrip()
        found.append(line)
    return found


def _depth(text: str) -> int:
    """How many brackets are open at the end of a text."""
    return sum(text.count(sign) for sign in "[{") - sum(text.count(sign) for sign in "]}")


def shared_fields(names: list[str]) -> list[str]:
    """The fields, besides `type`, that all types have with the same schema."""
    if len(names) < 2:
        return []
    first, *others = (TYPES[name]["properties"] for name in names)
    return [
        field
        for field, part in first.items()
        if field != "type" and all(other.get(field) == part for other in others)
    ]


def entry(name: str, shared: Iterable[str]) -> list[str]:
    """The heading, the picture, the description, the example and the fields of a type."""
    part = TYPES[name]
    paragraphs = [" ".join(p.split()) for p in part["description"].split("\n\n")]
    lines = ["", f"### {word(name)}", "", *"\n\n".join(paragraphs).splitlines(), ""]
    if name in EXAMPLES:
        lines += [f"![{word(name)}](pictures/reference/{name}.jpg){{ width={WIDTH} }}", ""]
        lines += ["```yaml", *wrapped(EXAMPLES[name]["yaml"]), "```", ""]
    rows = table(part, shared)
    return [*lines, *rows, *strips(name)] if rows else lines[:-1]


def values_of(value: Mapping[str, Any]) -> list[str]:
    """The words that a field may be, or that its list may hold; none of other fields."""
    parts = [value, *value.get("anyOf", ()), value.get("items", {})]
    return [word for part in parts for word in part.get("enum", ())]


FIELDS = {
    f"{name}.{field}": words
    for name, part in {"Scene": SCHEMA, **TYPES}.items()
    for field, value in part["properties"].items()
    if (words := values_of(value))
}
"""The values of each field that are words."""


def strips(name: str) -> list[str]:
    """The pictures of all values of each field of a type."""
    lines = []
    for field, words in FIELDS.items():
        if field.startswith(f"{name}."):
            key = field.partition(".")[2]
            pictures = {f"{key}: {word}": f"values/{field}.{word}.jpg" for word in words}
            lines += strip(pictures)
    return lines


def strip(pictures: Mapping[str, str]) -> list[str]:
    """Pictures side by side, with what stands below each."""
    lines = ["", '<div class="values" markdown>']
    for text, file in pictures.items():
        picture = f"![{text}](pictures/reference/{file}){{ width={VALUE_SIZE[0]} }}"
        lines += [f'<figure markdown="span">{picture}<figcaption>{text}</figcaption></figure>']
    return [*lines, "</div>"]


def word(name: str) -> str:
    """What the scene file calls a type."""
    properties = TYPES[name]["properties"]
    if "const" in properties.get("type", {}):
        return str(properties["type"]["const"])
    return {"Film": "film", "UvMap": "uv"}.get(name) or next(iter(properties))


def table(part: Mapping[str, Any], left_out: Iterable[str], only: Iterable[str] = ()) -> list[str]:
    """The fields of a type as rows; none if there are none besides `type`."""
    required = part.get("required", ())
    rows = []
    for field, value in part["properties"].items():
        if "const" in value or field in left_out or (only and field not in only):
            continue
        text = " ".join(value["description"].split())
        default = default_of(field, value, required)
        rows.append(f"| `{field}` | {kind_of(value)} | {default} | {text} |")
        for name in set(_targets(value)) - LISTED:  # keys of a field that have no heading
            inner = table(TYPES[name], ())[2:]
            rows += [row.replace("| `", f"| `{field}.", 1) for row in inner]
    return ["| field | values | default | meaning |", "|---|---|---|---|", *rows] if rows else []


def default_of(field: str, value: Mapping[str, Any], required: Iterable[str]) -> str:
    if field in required:
        return "required"
    default = value.get("default")
    if default is None or default in ("", [], {}):
        return ""
    if isinstance(default, bool):
        return f"`{str(default).lower()}`"
    if isinstance(default, dict):
        return f"`{default['type']}`" if "type" in default else ""
    if isinstance(default, float):
        return f"{default:.4g}"
    if isinstance(default, list):
        return f"[{', '.join(f'{x:.4g}' if isinstance(x, float) else str(x) for x in default)}]"
    return str(default) if isinstance(default, int) else f"`{default}`"


def kind_of(value: Mapping[str, Any]) -> str:
    """The values of a field in words."""
    known = [one for one in value.get("anyOf", ()) if one.get("type") != "null"]
    if len(known) == 2 and known[1] == {**_TRIPLE, "items": known[0]}:
        return f"colour{_range(known[0])}"
    if known:
        return " or ".join(dict.fromkeys(kind_of(one) for one in known))
    if "enum" in value:
        return ", ".join(f"`{one}`" for one in value["enum"])
    if value.get("description") == "the name of a texture":
        return "a texture's name"
    targets = [t for t in dict.fromkeys(_targets(value)) if t in TYPES]
    kind = value.get("type")
    if kind == "array":
        return _array(value, targets)
    if targets:
        return f"by name: {_link(targets)}" if kind == "object" else _link(targets)
    return {
        "number": f"number{_range(value)}",
        "integer": f"integer{_range(value)}",
        "boolean": "`true`, `false`",
        "string": "text",
    }.get(str(kind), "keys")


_TRIPLE = {"type": "array", "minItems": 3, "maxItems": 3}


def _link(targets: list[str]) -> str:
    """A link to a type, or for several to the section of the first."""
    if len(targets) == 1:
        name = word(targets[0])
        return f"[{name}](#{anchor(name)})" if targets[0] in LISTED else "keys below"
    title = next(title for title, _, names in SECTIONS if targets[0] in names)
    return f"[{title.lower()}](#{anchor(title)})"


def _array(value: Mapping[str, Any], targets: list[str]) -> str:
    items = value.get("items") or value.get("prefixItems", [{}])[0]
    least, most = value.get("minItems"), value.get("maxItems")
    if targets:
        return f"a list of {_link(targets)}"
    if items.get("type") == "array" and least == most and most is not None:
        return f"{most} rows of {_array(items, [])}"
    if items.get("type") == "array":
        return f"a list of {_array(items, [])}"
    if "enum" in items:
        return f"a list of {', '.join(f'`{one}`' for one in items['enum'])}"
    if most is None:
        if least is not None and items.get("type") == "number":
            return f"{least} numbers or more"
        if items.get("type") == "number":
            return "a list of numbers"
        return "a list" if least is None else f"a list of at least {least}"
    count = str(most) if least == most else f"{least} or {most}"
    return f"{count} {'integers' if items.get('type') == 'integer' else 'numbers'}{_range(items)}"


def _range(value: Mapping[str, Any]) -> str:
    low = high = ""
    if "minimum" in value and "maximum" in value and value["maximum"] < 2.0**31:
        return f" from {value['minimum']:g} to {value['maximum']:g}"
    if "minimum" in value:
        low = f"≥ {value['minimum']:g}"
    elif "exclusiveMinimum" in value:
        low = f"> {value['exclusiveMinimum']:g}"
    if value.get("maximum", 2.0**31) < 2.0**31:
        high = f"≤ {value['maximum']:g}"
    elif value.get("exclusiveMaximum", 2.0**31) < 2.0**31:
        high = f"< {value['exclusiveMaximum']:g}"
    both = ", ".join(part for part in (low, high) if part)
    return f" {both}" if both else ""


def anchor(text: str) -> str:
    return text.lower().replace(" ", "-")


def main() -> None:
    """Write the page, and the pictures that are asked for."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    (PICTURES / "values").mkdir(exist_ok=True)
    for name in sys.argv[1:] or [*EXAMPLES, *FIELDS]:
        for value in FIELDS.get(name, ()):
            picture_of_value(name, value)
        if name in EXAMPLES:
            picture_of(name)
    with replacing(PAGE) as temporary:
        temporary.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()

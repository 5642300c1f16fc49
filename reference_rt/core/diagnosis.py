"""Validation errors for users: pydantic's error as one line, with the keys that lead to it."""

import reprlib
from collections.abc import Iterable, Iterator
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from reference_rt.util.errors import MOST_TOLD, SceneError, means, meant, meant_by

Keys = tuple[str | int, ...]


class FieldError(ValueError):
    """An error in one field that only a validator of the whole description can detect."""

    def __init__(self, field: str, message: str) -> None:
        super().__init__(message)
        self.field = field


_PLAIN = {
    "model_type": "keys with values",
    "model_attributes_type": "keys with values",
    "dict_type": "keys with values",
    "tuple_type": "a list",
    "string_type": "text",
}
"""What is expected, for errors that pydantic words in terms of Python's types."""

_NAMED = {
    **dict.fromkeys(("material", "base", "back", "first", "second"), "materials"),
    "group": "groups",
    **dict.fromkeys(("texture", "height", "normals"), "textures"),
}
"""The part of the scene that has what a field names."""

_ELSEWHERE = {
    "area": ("point", "a lamp is a shape whose material has the type 'emissive'"),
    **dict.fromkeys(
        ("spp", "samples"),
        ("filter", "samples per pixel are set in 'sampler', such as {type: sobol, spp: 64}"),
    ),
    **dict.fromkeys(
        ("gamma", "exposure"), ("filter", "a picture is linear; .png files have the sRGB curve")
    ),
    "aspect": ("fov_axis", "the width and height of 'film' give it"),
    "fov": ("film_distance", "the type 'perspective' has it"),
    **dict.fromkeys(
        ("color", "colour", "reflectance", "albedo", "emission", "radiance"),
        ("transform", "its 'material' has it: the name of one of 'materials'"),
    ),
    **{
        step: ("transform", f"it is a step of 'transform', such as [{{{step}: {example}}}]")
        for step, example in {
            "scale": "2",
            "translate": "[0, 0, 1]",
            "rotate": "{axis: [0, 1, 0], degrees: 90}",
            "matrix": "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]",
        }.items()
    },
    **dict.fromkeys(
        [
            "size",
            "min",
            "max",
            "width",
            "height",
            "depth",
            "length",
            "normal",
            "point",
            "position",
            "center",
            "p0",
            "p1",
        ],
        ("transform", "'transform' places, turns and scales it"),
    ),
    "roughness": ("reflectance", "a rough mirror has the type 'rough_conductor'"),
    **dict.fromkeys(
        ("sigma_s", "sigma_a"),
        ("albedo", "sigma_t is sigma_s + sigma_a, and albedo is sigma_s / sigma_t"),
    ),
    "g": ("phase", "it is set in 'phase', such as {type: hg, g: 0.5}"),
}
"""Keys and types that mean something else than one key of their place: what to write, where this
other key or type would be possible."""


def scene_error(model: type[BaseModel], error: ValidationError, data: Any) -> SceneError:
    """What pydantic reports about `data`: an error with all problems, one for each wrong value."""
    found: dict[Keys, str] = {}
    # What is unknown says what is meant; what is missing because of that is no problem of its own.
    reported = sorted(error.errors(include_url=False), key=lambda one: one["type"] == "missing")
    meant = _meant_keys(model, reported)
    for first in reported:
        if first["type"] == "missing" and first["loc"] in meant:
            continue
        message, keys = _problem(model, first, data)
        # What is inside a value that is wrong itself, or is tried as several types, counts once.
        found.setdefault(keys, message)
        if len(found) == MOST_TOLD:
            break
    errors = [SceneError(message, keys) for keys, message in found.items()]
    return SceneError(errors[0].message, errors[0].path, others=errors[1:])


RESOLVED = "reference_rt resolved scene"
"""What `convert --to json` writes says that it is this."""


def what_else(data: Any) -> str | None:
    """The message for data that is no scene as a whole; None for what may be one."""
    if not isinstance(data, dict):
        return "expected keys such as camera, shapes, lights"
    if data.get("format") == RESOLVED:
        return f"is a {RESOLVED}, for other renderers; expected the scene that it was made of"
    if isinstance(data.get("asset"), dict) and "version" in data["asset"]:
        return "is glTF; expected a file name that ends in .gltf"
    return None


def _meant_keys(model: type[BaseModel], reported: Iterable[Any]) -> set[Keys]:
    """The keys that are meant by unknown ones, each with those that lead to it."""
    found: set[Keys] = set()
    for one in reported:
        if one["type"] == "extra_forbidden":
            *outer, name = one["loc"]
            known = _models_at(model, tuple(outer))[0].__pydantic_fields__
            found.update((*outer, key) for key in meant_by(str(name), known))
    return found


def _problem(model: type[BaseModel], first: Any, data: Any) -> tuple[str, Keys]:
    """(message, keys) of one of pydantic's errors: the message is one line, the keys lead to the
    wrong value."""
    location: Keys = first["loc"]
    keys = _keys_in(data, location)
    message = first["msg"].removeprefix("Value error, ").replace("Input should be", "expected")
    message = message.replace("a valid integer", "a whole number").replace("a valid n", "a n")
    cause = first.get("ctx", {}).get("error")
    if isinstance(cause, FieldError):
        return message, (*keys, cause.field)
    if first["type"] == "extra_forbidden":
        known = _models_at(model, location[:-1])[0].__pydantic_fields__
        near = _instead(str(location[-1]), known)
        message = f"unknown key; expected one of: {', '.join(known)}{near}"
    elif first["type"] == "missing":
        message = f"missing; expected {_wanted(model, location)}"
    elif first["type"] == "union_tag_not_found":
        message = f"missing 'type'; expected one of: {_types(_models_at(model, location))}"
    elif first["type"] == "union_tag_invalid":
        known_types, tag = _types(_models_at(model, location)), first["ctx"]["tag"]
        near = _instead(tag, known_types.split(", "))
        shown = tag if len(tag) <= _MOST_SHOWN else f"{tag[:_MOST_SHOWN]}..."
        message = f"unknown type '{shown}'; expected one of: {known_types}{near}"
    elif first["type"] == "too_long":
        message = f"expected at most {_items(first['ctx']['max_length'])}, got {_size(first)}"
    elif first["type"] == "too_short":
        message = f"expected at least {_items(first['ctx']['min_length'])}, got {_size(first)}"
    elif first["type"].startswith("recursion"):
        message = "nested too deeply; expected fewer levels"
    elif first["type"] in _PLAIN:
        expected = _PLAIN[first["type"]] + _such_as(model, first)
        if first["type"] == "string_type" and keys and keys[-1] in _NAMED:
            expected = f"the name of one of '{_NAMED[str(keys[-1])]}'"
        message = f"expected {expected}"
        message += f", got {_shown(first['input'])}"
    elif first["type"] == "transform_step" and isinstance(first["input"], dict):
        message += f", got {_shown(list(first['input']))}"
    elif not isinstance(first["input"], dict | BaseModel) and "got " not in message:
        joint = "; " if {":", ";"} & set(message) else ", "
        message += f"{joint}got {_shown(first['input'])}"
    return message, keys


def _instead(word: str, known: Iterable[str]) -> str:
    """What to write in place of a key or a type; nothing where that is unknown."""
    known = [*known]
    beside, told = _ELSEWHERE.get(word, ("", ""))
    return f"; {told}" if beside in known and not means(word, known) else meant(word, known)


def _wanted(model: type[BaseModel], location: Keys) -> str:
    """What a missing key is for, by the first sentence of its documentation."""
    fields = _models_at(model, location[:-1])[0].model_fields
    field = fields.get(str(location[-1]))
    if field is None:  # an item of a list that is too short
        return "a value"
    about = (field.description or "").split("\n\n")[0]
    sentence = " ".join(about.split()).partition(". ")[0].rstrip(".")
    return f"a value: {sentence[:1].lower()}{sentence[1:]}" if sentence else "a value"


def _such_as(model: type[BaseModel], first: Any) -> str:
    """An example of what is expected in place of a value of another type, made of that value."""
    kind, value = first["type"], first["input"]
    models = _models_at(model, first["loc"])
    known = [name for name in map(_type_of, models) if name]
    if kind == "tuple_type" and isinstance(value, dict):
        fields = {name for one in models for name in one.__pydantic_fields__}
        items = [value, *value.values()]
        fitting = [one for one in items if isinstance(one, dict) and fields.issuperset(one)]
        return f", such as [{_shown(fitting[0])}]" if fitting else ""
    if kind == "dict_type" and known:
        return f" by name, such as {{a: {{type: {known[0]}}}}}"
    if kind.startswith("model") and known:
        return f", such as {{type: {value if value in known else known[0]}}}"
    return f": {', '.join(models[0].__pydantic_fields__)}" if kind.startswith("model") else ""


def _items(count: int) -> str:
    return "1 item" if count == 1 else f"{count} items"


def _size(first: Any) -> str:
    """The number of items that were given; of an iterator that was cut off, that it is more."""
    count = first["ctx"]["actual_length"]
    return "more" if count is None else str(count)


_MOST_SHOWN = 60
"""The most characters of a wrong value that a message repeats."""

_SHORT = reprlib.Repr()
"""Writes the first items of lists and keys: values may have millions."""
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = _MOST_SHOWN


def _shown(value: Any) -> str:
    if isinstance(value, BaseModel):
        return f"a {type(value).__name__}"
    if hasattr(value, "dtype") and hasattr(value, "shape"):
        return f"{value.dtype} of shape {value.shape}"
    try:
        text = _SHORT.repr(value)
    except ValueError:  # an integer of thousands of digits
        return f"an {type(value).__name__} too long to show"
    return text if len(text) <= _MOST_SHOWN else f"{text[:_MOST_SHOWN]}..."


def _keys_in(data: Any, location: Keys) -> Keys:
    """pydantic's location without the names of union members, which are not keys of the data."""
    keys: list[int | str] = []
    for position, key in enumerate(location):
        last = position == len(location) - 1
        if isinstance(data, dict) and (key in data or (last and key != data.get("type"))):
            keys.append(key)
            data = data.get(key)
        elif isinstance(data, list | tuple) and isinstance(key, int) and key < len(data):
            keys.append(key)
            data = data[key]
    return tuple(keys)


def _models_at(model: type[BaseModel], location: Keys) -> list[type[BaseModel]]:
    """The description classes possible at pydantic's location: several for a union."""
    models = [model]
    for key in location:
        chosen = [m for m in models if len(models) > 1 and _type_of(m) == key]
        fields = [m.__pydantic_fields__[key] for m in models if key in m.__pydantic_fields__]
        if chosen:
            models = chosen
        elif isinstance(key, str) and fields:
            models = list(_descriptions_in(fields[0].annotation)) or models
    return models


def _descriptions_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """All description classes in a field's annotation, at any depth."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _descriptions_in(part)


def _type_of(model: type[BaseModel]) -> Any:
    fields = model.__pydantic_fields__
    return fields["type"].default if "type" in fields else None


def _types(models: list[type[BaseModel]]) -> str:
    return ", ".join(str(_type_of(m)) for m in models)

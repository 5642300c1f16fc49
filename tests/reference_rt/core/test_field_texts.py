"""Every field of every description says what it means, at run time and in the JSON Schema."""

import importlib
import inspect
import pkgutil
import pydoc
import re

import reference_rt as rt
from reference_rt import query
from reference_rt.core.model import Description, field_texts

MOST_WORDS = 30
"""Words of a sentence."""


def descriptions():
    """All classes of descriptions, those that only others inherit from included."""
    for module in pkgutil.walk_packages(rt.__path__, "reference_rt."):
        if not module.name.endswith((".methods", "__main__")):
            importlib.import_module(module.name)
    found, waiting = [], [Description]
    while waiting:
        cls = waiting.pop()
        waiting += cls.__subclasses__()
        if cls.__module__.startswith("reference_rt."):
            found.append(cls)
    return sorted(set(found), key=lambda cls: cls.__qualname__)


ALL = descriptions()
FIELDS = [(cls, name) for cls in ALL for name in cls.__pydantic_fields__ if name != "type"]
FIELDS += [
    (cls, "type") for cls in ALL if "type" in cls.__annotations__ and not cls.__subclasses__()
]


def test_there_are_all():
    assert len(ALL) > 60
    assert len(FIELDS) > 200
    used = rt.json_schema()["$defs"]
    assert set(used) <= {cls.__name__ for cls in ALL}


def test_a_field_has_a_text():
    for cls, name in FIELDS:
        text, where = cls.model_fields[name].description, f"{cls.__name__}.{name}"
        assert text, where
        assert text == field_texts(cls)[name], where
        assert text.rstrip().endswith("."), where
        longest = max(len(sentence.split()) for sentence in re.split(r"(?<=[.:;])\s", text))
        assert longest <= MOST_WORDS, where


def properties(schema):
    """(type, field, property) of everything in the JSON Schema."""
    for name, part in {"Scene": schema, **schema["$defs"]}.items():
        for field, found in part.get("properties", {}).items():
            yield name, field, found


def test_the_schema_has_the_same_texts():
    classes = {cls.__name__: cls for cls in ALL}
    found = list(properties(rt.json_schema()))
    assert len(found) > 250
    for name, field, part in found:
        assert part.get("description") == classes[name].model_fields[field].description


def test_every_class_says_what_it_is():
    for cls in ALL:
        assert vars(cls)["__doc__"]
        assert vars(cls)["__doc__"] != vars(cls.__base__).get("__doc__")


def test_help_says_in_forty_lines_what_the_fields_mean():
    for cls in ALL:
        said = pydoc.render_doc(cls, renderer=pydoc.plaintext)
        assert said.count("\n") <= 40, cls
        words = " ".join(said.replace("|", " ").split())
        for name, text in field_texts(cls).items():
            assert name == "type" or f"{name}: {' '.join(text.replace('|', ' ').split())}" in words
    public = {getattr(module, name) for module in (rt, query) for name in module.__all__}
    for cls in filter(inspect.isclass, public - {rt.Picture}):  # has its methods, too
        said = pydoc.render_doc(cls, renderer=pydoc.plaintext)
        assert said.count("\n") <= 40 or issubclass(cls, tuple), cls
    assert " load, " in pydoc.render_doc(rt.Scene, renderer=pydoc.plaintext)
    assert "model_validate" not in pydoc.render_doc(rt.Scene, renderer=pydoc.plaintext)
    assert "model_validate" in dir(rt.Scene)

"""What we use of Mitsuba by name: that it is listed, and that a version without it is told."""

import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from comparisons.mitsuba import backend, uses
from comparisons.mitsuba.plugin_table import PluginTable
from comparisons.translator import to_mitsuba
from reference_rt import Scene
from reference_rt.util.errors import ReferenceUnavailableError

SCENES = sorted((Path(__file__).parents[3] / "scenes").glob("*.yaml"))

PLUGINS = Path(backend.__file__).parent / "plugins"

OURS = {
    name
    for path in PLUGINS.glob("*.py")
    for name in re.findall(r'mi\.register_\w+\("(\w+)"', path.read_text(encoding="utf-8"))
}
"""The plugins that we register.  Once it has made one, Mitsuba's manager lists it, too."""

NOT_PLUGINS = {"rgb", "ref"}
"""Types of Mitsuba's dictionaries that are no plugins."""


def types(part):
    """The types in a dictionary of Mitsuba's."""
    if isinstance(part, dict):
        if isinstance(part.get("type"), str):
            yield part["type"]
        for one in part.values():
            yield from types(one)


@pytest.mark.cases(6)
@pytest.mark.parametrize("native", [False, True])
@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_every_plugin_of_a_scene_is_listed(path, native):
    """But for ours."""
    backend.mitsuba()
    found = set(types(to_mitsuba(Scene.load(path), native=native)))
    assert found - NOT_PLUGINS - OURS <= set(uses.PLUGINS)


def test_every_table_is_of_a_plugin_that_is_listed():
    """Tables of scenes that we read and of those that we write."""
    backend.mitsuba()
    ours = [module for name, module in sys.modules.items() if name.startswith("comparisons.")]
    values = [value for module in ours for value in vars(module).values()]
    tables = [value for value in values if isinstance(value, PluginTable)]
    assert len(tables) > 20
    assert {table.plugin for table in tables} - OURS <= set(uses.PLUGINS)


def test_this_version_has_all():
    assert uses.lacking(backend.mitsuba()) == ()


def test_a_version_without_a_plugin_is_told(monkeypatch):
    """Both versions, and each name that is gone."""
    monkeypatch.setattr(uses, "PLUGINS", (*uses.PLUGINS, "gone"))
    monkeypatch.setattr(uses, "IN_PYTHON", ("lost",))
    monkeypatch.setattr(uses, "OF_MESHES", (*uses.OF_MESHES, "vertex_moods"))
    backend.mitsuba()
    other = replace(backend.backend(), version="3.10.0")
    monkeypatch.setattr(backend, "backend", lambda: other)
    with pytest.raises(ReferenceUnavailableError) as told:
        backend.mitsuba.__wrapped__()
    for words in ("Mitsuba 3.10.0", "3.9.1", "'gone'", "'lost'", "'vertex_moods' of meshes"):
        assert words in str(told.value)


def test_another_version_with_all_goes_on(monkeypatch):
    backend.mitsuba()
    other = replace(backend.backend(), version="3.9.2")
    monkeypatch.setattr(backend, "backend", lambda: other)
    assert backend.mitsuba.__wrapped__() is not None

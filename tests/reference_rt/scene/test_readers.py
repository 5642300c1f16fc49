"""Readers of other programs' scenes: how they are found, and what is said without them."""

from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from reference_rt.rendering.scene import Scene
from reference_rt.scene import model
from reference_rt.util.errors import ReferenceUnavailableError, SceneError


def entries(*found: EntryPoint):
    return lambda group, name: [e for e in found if e.group == group and e.name == name]


def test_without_a_reader_the_message_says_what_to_install(monkeypatch):
    monkeypatch.setattr(model.importlib.metadata, "entry_points", entries())
    with pytest.raises(ReferenceUnavailableError, match=r"scene\.xml: .*pip install"):
        Scene.load("scene.xml")
    with pytest.raises(ReferenceUnavailableError, match="pip install"):
        Scene.from_mitsuba({"type": "scene"})
    with pytest.raises(SceneError, match=r"scene\.abc: is not a scene file"):
        Scene.load("scene.abc")


def test_with_a_broken_reader_too(monkeypatch):
    broken = EntryPoint("xml", "no_such_package.reader", model.GROUP)
    monkeypatch.setattr(model.importlib.metadata, "entry_points", entries(broken))
    with pytest.raises(ReferenceUnavailableError, match=r"scene\.xml: .*pip install"):
        Scene.load("scene.xml")


def test_a_reader_is_called_for_its_suffix(monkeypatch):
    def read_file(path: Path, cls: type[Scene], defaults: dict[str, str], some: bool) -> Scene:
        return cls(description=f"{path.name} {defaults} {some}")

    this = EntryPoint("abc", "test_readers", model.GROUP)
    monkeypatch.setattr(model.importlib.metadata, "entry_points", entries(this))
    monkeypatch.setattr(EntryPoint, "load", lambda self: type("M", (), {"read_file": read_file}))
    assert Scene.load("x/a.ABC", {"n": "1"}).description == "a.ABC {'n': '1'} False"
    assert Scene.load("a.abc").description == "a.abc {} False"
    assert Scene.load("a.abc", allow_missing=True).description == "a.abc {} True"


def test_gltf_under_another_name_is_told():
    """One sentence, and not an error for each of its keys."""
    with pytest.raises(SceneError, match=r"expected a file name that ends in \.gltf") as caught:
        Scene.parse('{"asset": {"version": "2.0"}, "scenes": [], "nodes": []}')
    assert not caught.value.others

"""What the README shows works as shown."""

import re
from pathlib import Path
from typing import Any

import pytest

from reference_rt import Scene, build_tables

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


def block(language: str, holds: str = "") -> str:
    """The first block of a language that holds a text."""
    blocks: list[str] = re.findall(rf"^```{language}\n(.*?)^```", README, re.DOTALL | re.MULTILINE)
    return next(text for text in blocks if holds in text)


def test_python_example(capsys: pytest.CaptureFixture[str]) -> None:
    exec(compile(block("python"), "README.md", "exec"), {})
    assert capsys.readouterr().out == "[2.] [0] [[0. 0. 1.]]\n"


def test_example_of_arrays() -> None:
    text = block("python", "import numpy").replace("scene.intersect", "found = scene.intersect")
    names: dict[str, Any] = {}
    exec(compile(text, "README.md", "exec"), names)
    assert names["found"].tolist() == [0]


def test_scene_example() -> None:
    scene = Scene.parse(block("yaml"))
    assert len(build_tables(scene).lights.choice.kind) == 2


@pytest.mark.parametrize("name", ["main-command", "test-command"])
def test_commands_are_where_ci_finds_them(name: str) -> None:
    assert re.search(rf"<!-- {name} -->\n```sh\npip install .*\n```\n<!-- end -->", README)

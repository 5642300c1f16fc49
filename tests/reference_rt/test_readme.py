"""What the README shows works as shown."""

import re
from pathlib import Path

import pytest

from reference_rt import Scene, build_tables

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    found = re.search(rf"^```{language}\n(.*?)^```", README, re.DOTALL | re.MULTILINE)
    assert found is not None
    return found.group(1)


def test_python_example(capsys: pytest.CaptureFixture[str]) -> None:
    exec(compile(block("python"), "README.md", "exec"), {})
    assert capsys.readouterr().out == "[2.] [0] [[0. 0. 1.]]\n"


def test_scene_example() -> None:
    scene = Scene.parse(block("yaml"))
    assert len(build_tables(scene).lights.choice.kind) == 2


@pytest.mark.parametrize("name", ["main-command", "test-command"])
def test_commands_are_where_ci_finds_them(name: str) -> None:
    assert re.search(rf"<!-- {name} -->\n```sh\npip install .*\n```\n<!-- end -->", README)

"""What packages, pre-commit and Read the Docs take from the repository is there."""

import re
import tomllib
from pathlib import Path

import yaml
from command_line import COMMANDS

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def test_a_wheel_has_every_file_that_is_not_python() -> None:
    for package, patterns in PROJECT["tool"]["setuptools"]["package-data"].items():
        folder = ROOT / package
        there = {path for path in folder.rglob("*.*") if path.is_file() and path.suffix != ".py"}
        there = {path for path in there if "__pycache__" not in path.parts}
        assert there
        assert there == {path for pattern in patterns for path in folder.glob(pattern)}


def test_the_hook_of_pre_commit_is_a_command_for_scene_files() -> None:
    (hook,) = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text(encoding="utf-8"))
    program, command = hook["entry"].split()
    assert program in PROJECT["project"]["scripts"]
    assert command in COMMANDS
    scenes = [path.relative_to(ROOT).as_posix() for path in (ROOT / "scenes").rglob("*.yaml")]
    assert len(scenes) > 100
    assert [name for name in scenes if not re.search(hook["files"], name)] == []
    assert not re.search(hook["files"], "mkdocs.yml")
    assert hook["id"] in (ROOT / "docs" / "howto.md").read_text(encoding="utf-8")


def test_read_the_docs_builds_what_there_is() -> None:
    build = yaml.safe_load((ROOT / ".readthedocs.yaml").read_text(encoding="utf-8"))
    assert (ROOT / build["mkdocs"]["configuration"]).is_file()
    (installed,) = build["python"]["install"]
    assert set(installed["extra_requirements"]) <= set(PROJECT["project"]["optional-dependencies"])


def test_both_files_that_name_the_authors_agree() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["authors"] == PROJECT["project"]["authors"]
    assert citation["version"] == PROJECT["project"]["version"]
    assert set(citation["keywords"]) <= set(PROJECT["project"]["keywords"])

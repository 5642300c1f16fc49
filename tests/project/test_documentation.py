"""What README.md and docs/ show works as shown."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from reference_rt import Scene, build_tables

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
MOST_README = 8192
"""Bytes: a newcomer reads it whole."""
MOST_PICTURES = 6 << 20
"""Bytes of all pictures: every clone has them."""


def blocks(page: Path, language: str) -> list[str]:
    """The blocks of a language."""
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def block(page: str, language: str, holds: str = "") -> str:
    """The first block of a language that holds a text."""
    return next(text for text in blocks(ROOT / page, language) if holds in text)


def test_the_readme_is_short() -> None:
    assert (ROOT / "README.md").stat().st_size <= MOST_README


def test_the_pictures_are_small() -> None:
    sizes = [path.stat().st_size for path in (ROOT / "docs/pictures").rglob("*.*")]
    assert len(sizes) > 60
    assert sum(sizes) <= MOST_PICTURES


@pytest.mark.parametrize("page", ["README.md", "docs/python.md"])
def test_python_example(page: str, capsys: pytest.CaptureFixture[str]) -> None:
    exec(compile(block(page, "python"), page, "exec"), {})
    assert capsys.readouterr().out == "[2.] [0] [[0. 0. 1.]]\n"


def test_example_of_arrays() -> None:
    text = block("docs/python.md", "python", "import numpy")
    names: dict[str, Any] = {}
    exec(compile(text.replace("scene.intersect", "found = scene.intersect"), "docs", "exec"), names)
    assert names["found"].tolist() == [0]


def test_example_of_the_gate(capsys: pytest.CaptureFixture[str]) -> None:
    exec(compile(block("docs/python.md", "python", "comparisons.gate"), "docs", "exec"), {})
    assert capsys.readouterr().out.startswith("differ - constant gain of ")


def scenes() -> list[Any]:
    """The scenes that pages show: blocks of YAML with shapes."""
    return [
        pytest.param(text, id=f"{page.stem}-{k}")
        for page in PAGES
        if page.stem != "scene_reference"  # parts of scenes: test_scene_reference.py
        for k, text in enumerate(blocks(page, "yaml"))
        if "shapes" in yaml.safe_load(text)
    ]


@pytest.mark.parametrize("text", scenes())
def test_scenes(text: str) -> None:
    lights = build_tables(Scene.parse(text)).lights.choice
    assert len(lights.kind) == 2


def test_links_within_the_repository() -> None:
    missing = []
    for page in PAGES:
        text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.M)
        links = re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", text)
        inside = [page.parent / link for link in links if "://" not in link]
        missing += [(page.name, link) for link in inside if not link.exists()]
    assert missing == []


def test_no_page_has_both_sides_of_a_merge() -> None:
    assert [path for path in PAGES if re.search("^(<{7}|>{7}) ", path.read_text(), re.M)] == []


def test_every_scene_is_in_the_gallery() -> None:
    gallery = (ROOT / "docs/gallery.md").read_text(encoding="utf-8")
    names = [path.stem for path in (ROOT / "scenes").glob("*.yaml")]
    missing = [n for n in names if f"(pictures/scenes/{n}.jpg)" not in gallery]
    assert missing == []  # docs/make_pictures.py adds them


def test_every_case_of_truth_is_on_its_page() -> None:
    page = (ROOT / "docs/truth.md").read_text(encoding="utf-8")
    names = [path.stem for path in (ROOT / "scenes/truth").glob("*.yaml")]
    missing = [n for n in names if f"(pictures/truth/{n}.png) | `{n}`" not in page]
    assert missing == []  # docs/make_pictures.py truth, and reference-rt truth --markdown
    assert [n for n in names if not re.search(f"^{n} +[●○.]", page, re.M)] == []  # make_faults.py


def test_every_page_is_in_the_contents() -> None:
    contents = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    pages = [
        path.relative_to(ROOT / "docs").as_posix()
        for path in PAGES
        if ROOT / "docs" in path.parents
    ]
    assert [page for page in pages if f": {page}" not in contents] == []


@pytest.mark.parametrize("name", ["main-command", "test-command"])
def test_commands_are_where_ci_finds_them(name: str) -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert re.search(rf"<!-- {name} -->\n```sh\npip install .*\n```\n<!-- end -->", readme)

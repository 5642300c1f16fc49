"""Files of configuration say each thing once, and what they are to load is loaded.

Most readers take the last of two equal keys without a word, and the first is lost.
"""

import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML
from ruamel.yaml.constructor import DuplicateKeyError

ROOT = Path(__file__).parents[2]
FOLDERS = (".github", "comparisons", "docs", "examples", "reference_rt", "scenes", "tests")
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]


def files(*suffixes: str) -> list[Path]:
    """Those of the repository."""
    found = [path for path in ROOT.iterdir() if path.is_file()]
    found += [path for folder in FOLDERS for path in (ROOT / folder).rglob("*.*")]
    return sorted(
        path for path in found if path.suffix in suffixes and "node_modules" not in path.parts
    )


def blocks(language: str) -> Iterator[tuple[str, str]]:
    """The name of a page, and a block of a language in it."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for block in re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
            yield page.name, block


def read_yaml(text: str) -> list[Any]:
    """The documents of a text.  Raises DuplicateKeyError."""
    return list(YAML(typ="safe").load_all(text))


def distinct(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    keys = [key for key, _ in pairs]
    assert sorted(keys) == sorted(set(keys))
    return dict(pairs)


def twice(texts: Iterator[tuple[str, str]]) -> list[str]:
    """The names of texts of YAML with a key that stands twice."""
    found = []
    for name, text in texts:
        try:
            read_yaml(text)
        except DuplicateKeyError as error:
            found.append(f"{name}: {error.problem}")
    return found


def test_no_key_stands_twice() -> None:
    described = files(".yaml", ".yml", ".cff")
    assert len(described) > 200
    assert twice((path.name, path.read_text(encoding="utf-8")) for path in described) == []
    assert twice(blocks("yaml")) == []
    for path in files(".json"):
        json.loads(path.read_text(encoding="utf-8"), object_pairs_hook=distinct)
    for path in files(".toml"):
        tomllib.loads(path.read_text(encoding="utf-8"))  # refuses them itself


def test_a_key_that_stands_twice_is_seen() -> None:
    text = "extra_css:\n  - a.css\nplugins: []\nextra_css:\n  - b.css\n"
    assert len(twice(iter([("mkdocs.yml", text)]))) == 1
    with pytest.raises(AssertionError):
        json.loads('{"a": {"b": 1, "b": 2}}', object_pairs_hook=distinct)


def test_the_site_links_every_stylesheet_and_script() -> None:
    """What stands in the folder of the documentation and is not linked is lost in silence."""
    (site,) = read_yaml((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    docs = ROOT / "docs"
    for suffix, key in ((".css", "extra_css"), (".js", "extra_javascript")):
        there = [path for path in files(suffix) if docs in path.parents]
        assert sorted(site.get(key, [])) == [path.relative_to(docs).as_posix() for path in there]
    assert site["extra_css"]


def test_every_stylesheet_and_script_of_our_pages_is_used() -> None:
    """`report.html` and its like have them inside: a template or a module names each."""
    package = ROOT / "comparisons"
    sources = [*package.rglob("*.jinja"), *package.rglob("*.py")]
    text = "\n".join(path.read_text(encoding="utf-8") for path in sources)
    there = [path for path in files(".css", ".js") if package in path.parents]
    assert len(there) > 8
    assert [path.name for path in there if f'"{path.name}"' not in text] == []

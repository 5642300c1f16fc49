"""The pages of docs/course: kernels are lines of the source, and what is shown runs as shown."""

import re
import sys
from pathlib import Path

import pytest
from command_line import invoke

from comparisons.truth.case import chosen

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "docs"))
from docs_pages import blocks_of, run  # noqa: E402

PAGES = sorted((ROOT / "docs" / "course").glob("*.md"))
MEASURING = re.compile("reference-rt (stability|methods|converge|compare|suite|bench|truth) ")
"""Commands of minutes, or of cases that their own tests render: here their options are read."""

pytestmark = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)


def lines(text: str) -> str:
    """Without indentation and empty lines, which formatting of Markdown changes."""
    return "\n".join(["", *filter(None, map(str.strip, text.splitlines())), ""])


def test_kernels_are_lines_of_the_source(page: Path) -> None:
    """In the order of the source; `...` stands for others between them."""
    for block in blocks_of(page):
        if block.language == "python" and block.title:
            source = lines((ROOT / block.title).read_text(encoding="utf-8"))
            for part in re.split(r"^ *\.\.\.\n", block.text, flags=re.MULTILINE):
                _, found, source = source.partition(lines(part))
                assert found, f"{block.title} has no longer:\n{part}"
                source = "\n" + source


def test_what_is_shown_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Prints what the page says, and writes the pictures that it shows."""
    monkeypatch.chdir(tmp_path)
    Path("scenes").symlink_to(ROOT / "scenes")
    Path("examples").symlink_to(ROOT / "examples")

    def shell(line: str) -> None:
        words = line.partition("#")[0].split()
        assert words[0] == "reference-rt", line
        help_only = ["--help"] if MEASURING.match(line) else []
        if words[1] == "truth":
            names = words[2 : words.index("--renderer")]
            assert [case.name for case in chosen(names)] == names
        result = invoke(*words[1:], *help_only, catch_exceptions=False)
        expected = re.search(r"# exit (\d)", line)
        assert result.exit_code == int(expected[1] if expected else 0), result.output

    for printed, said in run(page, shell):
        assert printed == said
    shown = re.findall(r"\.\./pictures/course/(\S+\.png)", page.read_text(encoding="utf-8"))
    assert [name for name in shown if not Path(name).exists()] == []

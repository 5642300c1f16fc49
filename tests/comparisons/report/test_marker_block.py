"""Tables that are written into files between markers."""

from pathlib import Path

import pytest

from comparisons.report.templates import END, begin, rewrite
from reference_rt.util.errors import UsageError

BEGIN = begin("bench")


def test_rewriting_a_file_is_idempotent(tmp_path: Path) -> None:
    path = tmp_path / "README.md"
    path.write_text(f"before\n{BEGIN}\nformer\n{END}\nafter\n<!-- end -->\n")
    text = "| a | table |\n"
    rewrite(path, "bench", text)
    once = path.read_text()
    rewrite(path, "bench", text)
    assert path.read_text() == once
    assert once.startswith(f"before\n{BEGIN}\n")
    assert once.endswith(f"{END}\nafter\n<!-- end -->\n")
    assert "former" not in once
    assert "| a | table |" in once


@pytest.mark.parametrize("text", ["", f"{BEGIN}\n", f"{END}\n{BEGIN}\n"])
def test_a_file_without_markers_is_refused_and_kept(tmp_path: Path, text: str) -> None:
    path = tmp_path / "README.md"
    path.write_text(text)
    with pytest.raises(UsageError, match="has no marker block"):
        rewrite(path, "bench", "x\n")
    assert path.read_text() == text


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be read"):
        rewrite(tmp_path / "README.md", "bench", "x\n")

"""`gate --beside`: other renderers' pictures on the page, which are not judged."""

from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from gate_checks import write
from report_page import Page

from comparisons.report.pictures_data import unpack

RIGHT = np.random.default_rng(1).uniform(0.2, 1.0, (8, 12, 3))
ASKED = ("gate", "c.exr", "--reference", "right.exr", "--noise-free")


@pytest.fixture(autouse=True)
def pictures(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    for name, picture in (("c", RIGHT), ("right", RIGHT), ("a", 2 * RIGHT), ("b", RIGHT[::-1])):
        write(f"{name}.exr", picture)
    write("small.exr", RIGHT[1:])


def test_they_are_on_the_page_and_not_judged() -> None:
    result = invoke(*ASKED, "--beside", "Cycles=a.exr", "--beside", "my old one=b.exr")
    assert result.exit_code == 0, result.output
    text = Path("out/report.html").read_text()
    (data,) = Page(text).data
    for found, given in zip(unpack(data).others, (2 * RIGHT, RIGHT[::-1]), strict=True):
        np.testing.assert_allclose(found, given, rtol=2**-23)
    assert '<option value="3">my old one</option>' in text


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (["--beside", "a.exr"], 2, "--beside: expected NAME=FILE, such as Cycles=c.exr, got 'a"),
        (["--beside", "a="], 2, "--beside: expected NAME=FILE"),
        (["--beside", "a=a.exr", "--beside", "a=b.exr"], 2, "expected a name for each, got 'a=b"),
        (["--beside", "a=none.exr"], 3, "none.exr: there is no such file"),
        (["--beside", "a=small.exr"], 3, "small.exr: is 12 x 7 pixels; expected 12 x 8, as the"),
        (["--beside", "a=a.exr", "--rim", "1"], 2, "--beside: does not apply to --rim"),
    ],
)
def test_what_is_wrong_with_them_is_told(words: list[str], code: int, told: str) -> None:
    result = invoke(*ASKED, *words)
    assert result.exit_code == code
    assert told in result.stderr

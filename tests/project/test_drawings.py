"""Pages of the course, and those on verdicts, begin with drawings, which a script makes."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from reference_rt.core.arrays import FloatArray

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "docs"))
from drawing import WIDTH, Glass, ball, crossings  # noqa: E402
from make_drawings import DRAWINGS, FOLDER, svg  # noqa: E402

PAGES = [
    *sorted((ROOT / "docs" / "course").glob("*.md")),
    *(ROOT / "docs" / f"{name}.md" for name in ("verdict", "truth", "gate")),
]
MOST = 40 << 10
"""Bytes of a drawing."""


def test_every_page_has_its_drawing() -> None:
    assert {page.stem for page in PAGES} == set(DRAWINGS)
    assert {path.stem for path in FOLDER.iterdir()} == set(DRAWINGS)


@pytest.mark.parametrize("name", DRAWINGS)
def test_drawings_are_what_the_script_makes(name: str) -> None:
    """`python docs/make_drawings.py` makes them again."""
    text = (FOLDER / f"{name}.svg").read_text(encoding="utf-8")
    assert text == svg(name)
    assert len(text.encode()) <= MOST


@pytest.mark.parametrize("name", DRAWINGS)
def test_letters_can_be_read_on_a_telephone(name: str) -> None:
    """12 pixels high, where a page of 400 pixels with a scroll bar leaves 353 to its text."""
    sizes = re.findall(r"(?:font:|font-size[:=]\"?)([\d.]+)", svg(name))
    assert sizes
    assert min(map(float, sizes)) * 353 / WIDTH >= 12


@pytest.mark.parametrize("height", [-0.9, 0.1, 0.6])
def test_glass_bends_rays_by_snell(height: float) -> None:
    """Sines of the angles by cross products, at both ends of the scene's own chord."""
    glass, o, d = ball(3.0, 1.0, 2.0), np.array([-2.0, 1.0 + 2.0 * height]), np.array([1.0, 0.0])
    p, n, mirrored, inside, q, out = Glass.hit(o, d, glass, 1.4)

    def sine(a: FloatArray, b: FloatArray) -> float:
        return float(a[0] * b[1] - a[1] * b[0])

    last = (q - (3.0, 1.0)) / 2.0
    assert p + crossings(p, inside, glass)[-1] * inside == pytest.approx(q, abs=1e-14)
    assert sine(d, n) == pytest.approx(1.4 * sine(inside, n), abs=1e-14)
    assert sine(out, last) == pytest.approx(1.4 * sine(inside, last), abs=1e-14)
    assert sine(mirrored, n) == pytest.approx(sine(d, n), abs=1e-14)
    assert d @ n < 0 < mirrored @ n
    assert inside @ n < 0 < out @ last


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_pages_begin_with_their_drawing(page: Path) -> None:
    """Before the first heading, after one short paragraph; its words say what is seen."""
    lines = page.read_text(encoding="utf-8").splitlines()
    up = "../" if page.parent.name == "course" else ""
    source = re.escape(f"{up}pictures/drawings/{page.stem}.svg")
    found = [re.fullmatch(rf"!\[(.+)\]\({source}\)", line) for line in lines[:12]]
    (at,) = (k for k, match in enumerate(found) if match)
    assert not any(line.startswith(("##", "```", "|")) for line in lines[:at])
    assert len(" ".join(lines[1:at])) < 200
    assert len(found[at][1].split()) >= 15

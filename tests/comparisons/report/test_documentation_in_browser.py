"""The documentation in a real browser: its drawings, and every page at the width of a telephone."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
DRAWINGS = ROOT / "docs" / "pictures" / "drawings"
PAGES = sorted(
    path.relative_to(ROOT / "docs").with_suffix("").as_posix()
    for path in (ROOT / "docs").rglob("*.md")
)
DRAWN = {*(p for p in PAGES if p.startswith("course/")), "verdict", "truth", "gate"}
"""Pages that begin with a drawing."""

LETTERS = """() => {
    const svg = document.querySelector("svg"), found = [];
    const letters = [...svg.querySelectorAll("text")].map((text) => {
        const { x, y, width, height } = text.getBBox();
        // Of a line's height the letters fill the middle: from the capitals' top to their feet.
        const [top, bottom] = [y + 0.24 * height, y + 0.79 * height];
        return { words: text.textContent, left: x - 3, right: x + width + 3, top, bottom };
    });
    const { width, height } = svg.viewBox.baseVal;
    letters.forEach((a, k) => {
        if (a.left < 0 || a.right > width || a.top < 2 || a.bottom > height - 2)
            found.push(`${a.words}: cut off`);
        for (const b of letters.slice(k + 1))
            if (a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom)
                found.push(`${a.words}: on ${b.words}`);
    });
    for (const mark of svg.querySelectorAll("path, circle")) {
        if (getComputedStyle(mark).stroke === "none") continue;
        const length = mark.getTotalLength(), at = {};
        for (let k = 0; k <= length; k += 1) {
            const { x, y } = mark.getPointAtLength(k);
            for (const a of letters)
                if (x > a.left && x < a.right && y > a.top && y < a.bottom) at[a.words] = [x, y];
        }
        found.push(...Object.entries(at).map(([words, p]) => `${words}: on a line at ${p}`));
    }
    return found;
}"""
"""What is wrong with the letters of a drawing: cut off, on each other, on lines."""

WIDTH_OF_M = """() => {
    const context = new OffscreenCanvas(9, 9).getContext("2d");
    context.font = "100px Arial,Helvetica,'Liberation Sans'";
    return Math.round(10 * context.measureText("m").width) / 10;
}"""


def test_letters_of_drawings_stand_free(window):
    window.goto((DRAWINGS / "rays.svg").as_uri())
    if window.evaluate(WIDTH_OF_M) != 83.3:
        pytest.skip("no Arial, nor a font with its widths")
    found = {}
    for path in sorted(DRAWINGS.glob("*.svg")):
        window.goto(path.as_uri())
        found[path.stem] = window.evaluate(LETTERS)
    assert len(found) == len(DRAWN)
    assert {name: each for name, each in found.items() if each} == {}


TOO_WIDE = """(width) => {
    document.querySelectorAll("details").forEach((details) => (details.open = true));
    const found = [];
    if (document.documentElement.scrollWidth > width) found.push("the page scrolls sideways");
    const scrolls = (element) => {
        for (let one = element; one && one !== document.body; one = one.parentElement)
            if (["auto", "scroll"].includes(getComputedStyle(one).overflowX)) return true;
        return false;
    };
    for (const element of document.querySelectorAll("main *")) {
        if (!element.checkVisibility() || element.closest(".md-sidebar")) continue;
        const { left, right, width: wide } = element.getBoundingClientRect();
        if (wide > 0 && (right > width + 1 || left < -1) && !scrolls(element))
            found.push(`${element.tagName}.${element.className}: ${left} to ${right}`);
    }
    return found;
}"""
"""What is wider than the window, and in nothing that scrolls by itself; folded parts are opened."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built documentation."""
    pytest.importorskip("mkdocs", reason="mkdocs is not installed: pip install '.[docs]'")
    built = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "-d", str(built)]
    subprocess.run(command, cwd=ROOT, check=True, timeout=300)
    return built


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_pages_fit_a_telephone_and_a_screen(window, site, page):
    """Nothing is cut off, and pages with a drawing show it at once."""
    window.goto((site / page.removesuffix("index") / "index.html").as_uri())
    for width, height in ((1400, 900), (400, 800)):
        window.set_viewport_size({"width": width, "height": height})
        drawing = window.locator("img[src*='/drawings/']")
        assert drawing.count() == (page in DRAWN)
        if page in DRAWN:
            place = drawing.bounding_box()
            assert place["y"] < 400
            assert place["y"] + place["height"] <= height
            # `make_drawings.py` relies on it for the size of letters.
            assert place["width"] >= min(353, width)
        assert window.evaluate(TOO_WIDE, width) == []

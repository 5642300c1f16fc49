"""The documentation in a real browser: its drawings, and every page at the width of a telephone."""

import subprocess
import sys
from pathlib import Path

import pytest
from page_in_browser import FIRST_PICTURE

ROOT = Path(__file__).parents[3]
DRAWINGS = ROOT / "docs" / "pictures" / "drawings"
DRAWN = [f"course/{path.stem}" for path in (ROOT / "docs" / "course").glob("*.md")]
PAGES = sorted(
    path.relative_to(ROOT / "docs").with_suffix("").as_posix()
    for path in (ROOT / "docs").rglob("*.md")
)

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


def test_letters_of_drawings_stand_free(browser):
    page = browser.new_page()
    paths = sorted(DRAWINGS.glob("*.svg"))
    found = {}
    for path in paths:
        page.goto(path.as_uri())
        found[path.stem] = page.evaluate(LETTERS)
    page.close()
    assert len(paths) >= 20
    assert {name: each for name, each in found.items() if each} == {}

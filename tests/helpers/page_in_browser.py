"""Cases for the page, and what a browser shows of it: for its tests."""

import numpy as np

from comparisons.results.case import Case, Images, Metrics, RungResult
from comparisons.statistics.metrics import encode

SIZE = 12, 8


CONTRASTS = """() => {
    const linear = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
    const parts = (text) => text.match(/[\\d.]+/g).map(Number);
    const luminance = ([r, g, b]) =>
        0.2126 * linear(r / 255) + 0.7152 * linear(g / 255) + 0.0722 * linear(b / 255);
    const behind = (element) => {
        for (let one = element; one; one = one.parentElement) {
            const colour = parts(getComputedStyle(one).backgroundColor);
            if (colour.length === 3 || colour[3] === 1) return colour;
        }
        return [255, 255, 255];
    };
    const found = [];
    for (const element of document.querySelectorAll("body *")) {
        const text = [...element.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
        if (!text || !element.checkVisibility()) continue;
        if (element.closest("svg, .unseen, option")) continue;
        const [a, b] = [parts(getComputedStyle(element).color), behind(element)].map(luminance);
        const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
        if (contrast < 4.5) found.push(`${element.tagName}.${element.className}: ${contrast}`);
    }
    return found;
}"""
"""Elements whose text has a contrast below 4.5, as text."""

BROKEN_WORDS = """() => {
    const found = [];
    const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    while (walker.nextNode()) {
        const { data, parentElement } = walker.currentNode;
        if (!parentElement.checkVisibility()) continue;
        if (parentElement.closest("svg, .unseen, option")) continue;
        for (const word of data.matchAll(/[\\p{L}\\p{N}]{2,}/gu)) {
            // What is longer than the longest words has to be broken somewhere.
            if (word[0].length > 24) continue;
            const range = document.createRange();
            range.setStart(walker.currentNode, word.index);
            range.setEnd(walker.currentNode, word.index + word[0].length);
            const lines = [...range.getClientRects()].filter(({ width }) => width > 0);
            if (new Set(lines.map(({ top }) => Math.round(top))).size > 1) found.push(word[0]);
        }
    }
    return found;
}"""
"""Words, and parts of names between underscores, that stand on two lines."""

FIRST_PICTURE = """() => Math.min(
    ...[...document.querySelectorAll("img, canvas, svg")]
        .map((element) => element.getBoundingClientRect())
        .filter(({ height }) => height > 40).map(({ top }) => top + scrollY)
)"""
"""Where the first picture or chart begins, in pixels; infinite if there is none."""


def case(images, scene="box", verdict="differ", reason="why", **more):
    metrics = Metrics(0.9, 0.1, 30.0, 0.5, 0.25, (0.0, 0.0, -0.01), 0)
    rungs = (RungResult("geometry", "agree", "holds", {"rays": 7}),)
    return Case(scene, verdict, reason, rungs, metrics, {"ours": {"load": 1.0}}, images, **more)


def grey(value, size=SIZE):
    return np.full((size[1], size[0], 3), value)


def pixel(page, kind, x, y, number=1):
    """The colour on a canvas, once the case is drawn."""
    page.wait_for_selector(f"#case-{number}[data-drawn]", state="attached")
    return tuple(
        page.evaluate(
            """([selector, x, y]) => [...document.querySelector(selector)
                .getContext("2d").getImageData(x, y, 1, 1).data].slice(0, 3)""",
            [f"#case-{number} .{kind} canvas", x, y],
        )
    )


def drawn(page, **look):
    """Wait until the first case is drawn so."""
    page.wait_for_function(
        """(look) => {
            const drawn = document.querySelector("#case-1").dataset.drawn;
            return drawn && Object.entries(look).every(([k, v]) => JSON.parse(drawn)[k] === v);
        }""",
        arg=look,
    )


def read(page, row, number=1):
    """The numbers at the cursor, as text."""
    return page.locator(f"#case-{number} [data-row={row}] td").all_text_contents()


def shown(page):
    """Kinds of the pictures of the first case that show."""
    figures = page.locator("#case-1 .row figure")
    return [
        figures.nth(i).get_attribute("data-kind")
        for i in range(figures.count())
        if figures.nth(i).is_visible()
    ]


def display(radiance, white=1.0):
    """The sRGB value that a radiance has on the page."""
    return round(255 * float(encode(np.array(radiance), white)))


def point(page, x, y, kind="candidate", size=SIZE, number=1):
    """Put the mouse on a pixel of an unzoomed picture."""
    pixel(page, kind, 0, 0, number)
    frame = page.locator(f"#case-{number} .{kind} .frame")
    frame.scroll_into_view_if_needed()
    box = frame.bounding_box()
    step = box["width"] / size[0], box["height"] / size[1]
    page.mouse.move(box["x"] + (x + 0.5) * step[0], box["y"] + (y + 0.5) * step[1])


def visible_part(page, kind="candidate"):
    """Left, top, width and height of what shows of a picture, in its pixels."""
    frame = page.locator(f".{kind} .frame").bounding_box()
    canvas = page.locator(f".{kind} canvas").bounding_box()
    scale = SIZE[0] / canvas["width"], SIZE[1] / canvas["height"]
    return (
        (frame["x"] - canvas["x"]) * scale[0],
        (frame["y"] - canvas["y"]) * scale[1],
        frame["width"] * scale[0],
        frame["height"] * scale[1],
    )


def centre(page, x, y):
    box = page.locator("#case-1 .candidate .frame").bounding_box()
    return box["x"] + (x + 0.5) * box["width"] / SIZE[0], box["y"] + (y + 0.5) * box[
        "height"
    ] / SIZE[1]


# A page of several cases

PICTURES = Images(grey(0.25), grey(1.0), grey(0.1))


def measured(scene, verdict, flip, seconds, images=PICTURES):
    metrics = Metrics(0.9, flip, 30.0, 0.5, 0.25, (0.0, 0.0, -0.01), 0)
    made = case(images, scene, verdict)
    times = {"candidate": {"render": seconds}}
    return type(made)(**{**vars(made), "metrics": metrics, "seconds": times})


FOUR = (
    measured("b", "agree", 0.001, 3.0),
    measured("d", "differ", 0.3, 20.0),
    measured("a", "invalid", float("nan"), 100.0),
    measured("c", "differ", 0.02, 1.0),
)

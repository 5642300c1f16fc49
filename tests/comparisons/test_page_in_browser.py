"""The page in a real browser, opened from disk: it loads, its controls do what they say."""

import io
import json
import math
import os
import re
import shutil
from importlib.resources import files

import numpy as np
import pytest
from PIL import Image

from comparisons.metrics import encode
from comparisons.report import write_report
from comparisons.report.pictures_data import as_json, pack, unpack
from comparisons.report.thumbnails import MAGENTA, RED
from comparisons.results import Case, Images, Metrics, Place, Tier

playwright = pytest.importorskip(
    "playwright.sync_api", reason="playwright is not installed: pip install 'reference-rt[test]'"
)

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
SIZE = 12, 8
WIDE = {"width": 1200, "height": 900}


@pytest.fixture(scope="module")
def browser():
    named = os.environ.get("CHROMIUM")
    found = named or next(filter(None, map(shutil.which, BROWSERS)), None)
    if not found:
        pytest.skip(f"no browser: set CHROMIUM, or install one of {', '.join(BROWSERS)}")
    with playwright.sync_playwright() as driver:
        # A sandbox needs rights that a container does not give; the page is our own.
        yield driver.chromium.launch(executable_path=found, args=["--no-sandbox"])


@pytest.fixture(scope="module")
def window(browser):
    """One page for all tests, which is quicker than one for each."""
    return browser.new_context(viewport=WIDE, offline=True).new_page()


@pytest.fixture
def show(browser, window, tmp_path):
    """Write a page about cases and open it; it must neither complain nor ask for anything."""
    complaints, requests, contexts = [], [], []
    listeners = {
        "console": lambda message: complaints.append(message.text),
        "pageerror": lambda error: complaints.append(str(error)),
        "dialog": lambda dialog: complaints.append(dialog.message),
        "request": lambda request: requests.append(request.url),
    }

    def opened(*cases, report=None, **options):
        path = tmp_path / "report.html"
        write_report(path, cases, {"date": "2025-11-20"}, **(report or {}))
        page = window
        if options:
            contexts.append(browser.new_context(**{"viewport": WIDE} | options))
            page = contexts[0].new_page()
        for event, listener in listeners.items():
            page.on(event, listener)
        page.goto(path.as_uri())
        return page

    yield opened
    for context in contexts:
        context.close()
    if not contexts:
        for event, listener in listeners.items():
            window.remove_listener(event, listener)
    assert complaints == []
    asked = [url for url in requests if not url.startswith("data:")]
    assert [url.startswith("file:") for url in asked] == [True]


def case(images, scene="box", verdict="differ", reason="why", **more):
    metrics = Metrics(0.9, 0.1, 30.0, 0.5, 0.25, (0.0, 0.0, -0.01), 0)
    tiers = (Tier("geometry", "agree", "holds", {"rays": 7}),)
    return Case(scene, verdict, reason, tiers, metrics, {"ours": {"load": 1.0}}, images, **more)


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
    figures = page.locator("#case-1 figure")
    return [
        figures.nth(i).get_attribute("data-kind")
        for i in range(figures.count())
        if figures.nth(i).is_visible()
    ]


def display(radiance, white=1.0):
    """The sRGB value that a radiance has on the page."""
    return round(255 * float(encode(np.array(radiance), white)))


# What is drawn


def test_the_browser_unpacks_what_was_packed(show):
    rng = np.random.default_rng(2)
    candidate = rng.lognormal(sigma=4.0, size=(9, 11, 3)) * rng.choice([-1, 0, 1], (9, 11, 3))
    reference = candidate * (1 + 10.0 ** rng.uniform(-9, 1, (9, 11, 3)))
    candidate[0, :4, 0] = math.nan, math.inf, -math.inf, 1e300
    error = rng.lognormal(size=(9, 11, 3))
    tiny = np.full((2, 3, 3), 5e-324)
    unpacking = (files("comparisons.report") / "unpack.js").read_text(encoding="utf-8")
    page = show()
    for images in (
        Images(candidate, reference, error),
        Images(candidate, reference[:5]),
        Images(tiny, -tiny),
    ):
        data = pack(images)
        expected = unpack(data)
        got = page.evaluate(
            f"""async (data) => {{
                {unpacking}
                const pictures = await unpack(JSON.parse(data));
                const flat = ([kind, picture]) => [kind, picture && [...(picture.values ?? [])]];
                return Object.fromEntries(Object.entries(pictures).map(flat));
            }}""",
            as_json(data),
        )
        for kind in ("candidate", "reference", "difference", "error"):
            values = getattr(expected, kind)
            if values is None:
                assert got[kind] is None
            else:
                np.testing.assert_array_equal(np.array(got[kind]), values.ravel())


def test_colours_are_those_of_the_thumbnails(show):
    ramp = np.linspace(0.0, 1.2, 96).reshape(8, 12)[..., None] * (1.0, 0.5, 0.1)
    page = show(case(Images(ramp, ramp * 0.9)))
    white = float(page.locator("#case-1 .pictures").get_attribute("data-white"))
    for x, y in ((0, 0), (5, 3), (11, 7)):
        expected = [display(v, white) for v in ramp[y, x]]
        assert np.abs(np.subtract(pixel(page, "candidate", x, y), expected)).max() <= 1


def test_exposure_doubles_radiance(show):
    page = show(case(Images(grey(0.2), grey(1.0))))
    assert pixel(page, "candidate", 0, 0) == (display(0.2),) * 3
    page.keyboard.press("+")
    drawn(page, stops=1)
    assert pixel(page, "candidate", 0, 0) == (display(0.4),) * 3
    assert "White is radiance 0.5" in page.locator(".exposed").inner_text()
    page.keyboard.press("-")
    page.keyboard.press("-")
    drawn(page, stops=-1)
    assert pixel(page, "candidate", 0, 0) == (display(0.1),) * 3
    page.keyboard.press("0")
    drawn(page, stops=0)
    page.locator("#stops").fill("2")
    drawn(page, stops=2)
    assert pixel(page, "candidate", 0, 0) == (display(0.8),) * 3


def test_exposure_moves_the_scale_of_the_difference(show):
    page = show(case(Images(grey(1.25), grey(1.0))))
    assert pixel(page, "difference", 3, 3) == RED
    assert page.locator(".high").inner_text() == "+0.25"
    page.keyboard.press("-")
    drawn(page, stops=-1)
    assert page.locator(".high").inner_text() == "+0.5"
    halfway = tuple(round(255 + (end - 255) / 2) for end in RED)
    assert np.abs(np.subtract(pixel(page, "difference", 3, 3), halfway)).max() <= 1


def test_false_colour(show):
    candidate = grey(1.0)
    candidate[0, :3] = [[0.0], [0.5], [2.0**-5]]
    page = show(case(Images(candidate, grey(1.0))))
    page.locator("#colours").select_option("linear")
    drawn(page, colours="linear")
    # viridis at 0, 1/2 and 1
    expected = {0: (68, 1, 84), 1: (33, 145, 140), 5: (253, 231, 37)}
    assert {x: pixel(page, "candidate", x, 0) for x in expected} == expected
    assert "yellow is 1, purple is 0" in page.locator(".exposed").inner_text()
    page.locator("#colours").blur()
    page.keyboard.press("c")
    drawn(page, colours="log")
    assert pixel(page, "candidate", 0, 0) == (68, 1, 84)
    assert pixel(page, "candidate", 2, 0) == (33, 145, 140)
    page.keyboard.press("c")
    drawn(page, colours="srgb")
    assert pixel(page, "candidate", 5, 0) == (255, 255, 255)


def test_z_map(show):
    candidate, error = grey(1.0), grey(0.01)
    candidate[2, 3, 1] -= 0.025
    candidate[4, 5, 0] += 0.07
    candidate[6, 7] += 0.01
    error[6, 6:8] = 0.0
    page = show(case(Images(candidate, grey(1.0), error)))
    assert pixel(page, "z", 0, 0) == (255, 255, 255)
    halfway = tuple(round(255 + (end - 255) / 2) for end in (33, 102, 172))
    assert np.abs(np.subtract(pixel(page, "z", 3, 2), halfway)).max() <= 8
    assert pixel(page, "z", 5, 4) == RED
    # Without noise, any difference is too large, and none is none.
    assert pixel(page, "z", 7, 6) == RED
    assert pixel(page, "z", 6, 6) == (255, 255, 255)
    point(page, 3, 2)
    assert read(page, "z")[0] == "0"
    assert float(read(page, "z")[1].replace("−", "-")) == pytest.approx(-2.5, rel=0.1)
    point(page, 7, 6)
    assert read(page, "z") == ["∞"] * 3


def test_what_is_not_finite_is_magenta_and_readable(show):
    candidate = grey(0.5)
    candidate[1, 2] = math.nan, math.inf, -math.inf
    page = show(case(Images(candidate, grey(0.5), grey(0.1)), verdict="invalid"))
    assert [pixel(page, kind, 2, 1) for kind in ("candidate", "difference", "z")] == [MAGENTA] * 3
    assert pixel(page, "reference", 2, 1) != MAGENTA
    point(page, 2, 1)
    assert read(page, "candidate") == ["NaN", "∞", "−∞"]
    assert read(page, "reference") == ["0.5"] * 3
    assert read(page, "difference") == ["NaN", "∞", "−∞"]


# Views


def test_the_views(show):
    page = show(case(Images(grey(0.25), grey(1.0), grey(0.1))))
    pixel(page, "z", 0, 0)
    assert shown(page) == ["candidate", "reference", "difference", "z"]
    page.keyboard.press("2")
    assert shown(page) == ["candidate"]
    page.keyboard.press("f")
    assert shown(page) == ["reference"]
    page.keyboard.press("f")
    assert shown(page) == ["candidate"]
    page.keyboard.press("4")
    assert shown(page) == ["candidate", "reference"]
    page.keyboard.press("5")
    for kind in ("reference", "difference", "z", "candidate"):
        page.keyboard.press("f")
        assert shown(page) == [kind]
        style = page.evaluate(f"getComputedStyle(document.querySelector('.{kind} canvas'))")
        assert style["imageRendering"] == "pixelated"
    page.locator("#which").select_option("z")
    assert shown(page) == ["z"]
    page.get_by_label("side by side", exact=True).check()
    assert len(shown(page)) == 4
    page.keyboard.press("f")
    assert page.get_by_label("flip", exact=True).is_checked()


def test_blinking(show):
    page = show(case(Images(grey(0.25), grey(1.0))))
    page.keyboard.press("3")
    for kind in ("reference", "candidate"):
        page.wait_for_selector(f"body[data-which={kind}]")
        assert shown(page) == [kind]
    page.keyboard.press("1")
    assert len(shown(page)) == 3


def test_a_single_view_says_what_a_case_lacks(show):
    page = show(case(Images(grey(0.25), grey(1.0, (3, 3)))))
    page.keyboard.press("5")
    page.locator("#which").select_option("difference")
    assert shown(page) == []
    assert page.get_by_text("This case has no such picture").is_visible()


def test_the_slider(show):
    page = show(case(Images(grey(0.25), grey(1.0))))
    page.keyboard.press("4")
    pixel(page, "candidate", 0, 0)
    page.locator(".wipe input").fill("25")
    page.locator("h1").hover()
    picture = Image.open(io.BytesIO(page.locator("#case-1 .reference .frame").screenshot()))
    middle = picture.height // 2
    left, right = (picture.getpixel((int(f * picture.width), middle))[:3] for f in (0.2, 0.3))
    assert left == (display(0.25),) * 3
    assert right == (255, 255, 255)


# The cursor and zoom


def point(page, x, y, kind="candidate", size=SIZE, number=1):
    """Put the mouse on a pixel of an unzoomed picture."""
    pixel(page, kind, 0, 0, number)
    frame = page.locator(f"#case-{number} .{kind} .frame")
    frame.scroll_into_view_if_needed()
    box = frame.bounding_box()
    step = box["width"] / size[0], box["height"] / size[1]
    page.mouse.move(box["x"] + (x + 0.5) * step[0], box["y"] + (y + 0.5) * step[1])


def test_pixels_read_what_the_arrays_hold(show):
    rng = np.random.default_rng(3)
    candidate, reference, error = rng.lognormal(sigma=2.0, size=(3, SIZE[1], SIZE[0], 3))
    page = show(case(Images(candidate, reference, error)))
    for kind, x, y in (("candidate", 0, 0), ("reference", 11, 7), ("difference", 4, 6)):
        point(page, x, y, kind)
        assert page.locator(".place").inner_text() == f"x {x}, y {y}"
        difference = candidate[y, x] - reference[y, x]
        # Rounding to the digits shown, and what is stored.
        rows = {
            "candidate": (candidate[y, x], 0.5e-2 + 2**-10),
            "reference": (reference[y, x], 0.5e-2 + 2**-11),
            "difference": (difference, 0.5e-1 + 2**-6),
            "z": (difference / error[y, x], 0.5e-1 + 2**-6 + 2**-4),
        }
        for row, (values, tolerance) in rows.items():
            texts = [text.replace("−", "-") for text in read(page, row)]
            assert [float(text) for text in texts] == pytest.approx(values, rel=tolerance)


def test_the_cursor_moves_by_keys_in_all_pictures_at_once(show):
    candidate = np.arange(96.0).reshape(8, 12)[..., None] * np.ones(3)
    page = show(case(Images(candidate, grey(1.0))))
    pixel(page, "candidate", 0, 0)
    page.keyboard.press("n")
    assert page.evaluate("document.activeElement.className") == "row"
    assert read(page, "candidate") == [f"{4 * 12 + 6}"] * 3
    for key in ("ArrowLeft", "ArrowUp", "ArrowUp"):
        page.keyboard.press(key)
    assert page.locator(".place").inner_text() == "x 5, y 2"
    assert read(page, "candidate") == ["29"] * 3
    page.keyboard.press("Shift+ArrowRight")
    page.keyboard.press("ArrowDown")
    assert page.locator(".place").inner_text() == "x 11, y 3"
    for kind in ("candidate", "reference", "difference"):
        frame = page.locator(f".{kind} .frame").bounding_box()
        mark = page.locator(f".{kind} .cursor").bounding_box()
        assert (mark["x"] - frame["x"]) / frame["width"] == pytest.approx(11 / 12, abs=1e-3)
        assert (mark["y"] - frame["y"]) / frame["height"] == pytest.approx(3 / 8, abs=1e-3)


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


def test_zoom_and_pan(show):
    page = show(case(Images(grey(0.25), grey(1.0))))
    point(page, 3, 2)
    page.mouse.dblclick(*centre(page, 3, 2))
    left, top, width, height = visible_part(page)
    assert (width, height) == pytest.approx((6, 4), abs=0.01)
    # The pixel stays under the mouse.
    assert (left, top) == pytest.approx((3.5 / 2, 2.5 / 2), abs=0.1)
    assert visible_part(page, "difference") == pytest.approx((left, top, width, height), abs=0.01)
    page.mouse.down()
    x, y = centre(page, 3, 2)
    page.mouse.move(x - 30, y - 20, steps=3)
    page.mouse.up()
    assert visible_part(page)[0] > left + 0.2
    assert visible_part(page)[1] > top + 0.2
    page.get_by_role("button", name="whole").click()
    assert visible_part(page) == pytest.approx((0, 0, 12, 8), abs=0.01)
    point(page, 3, 2)
    page.keyboard.down("Control")
    page.mouse.wheel(0, -200)
    page.keyboard.up("Control")
    page.wait_for_selector(".zoomed")
    page.keyboard.press("o")
    page.wait_for_selector(".pictures:not(.zoomed)")
    page.keyboard.press("i")
    assert visible_part(page)[2] == pytest.approx(6, abs=0.01)


def centre(page, x, y):
    box = page.locator("#case-1 .candidate .frame").bounding_box()
    return box["x"] + (x + 0.5) * box["width"] / SIZE[0], box["y"] + (y + 0.5) * box[
        "height"
    ] / SIZE[1]


def test_the_view_follows_the_cursor(show):
    page = show(case(Images(grey(0.25), grey(1.0))))
    pixel(page, "candidate", 0, 0)
    page.locator("#case-1 .row").focus()
    page.keyboard.press("i")
    for _ in range(3):
        page.keyboard.press("Shift+ArrowRight")
    left, _, width, _ = visible_part(page)
    assert left + width == pytest.approx(12, abs=0.01)


def test_a_worst_place_is_shown_large(show):
    size = 64, 48
    candidate = grey(1.0, size)
    candidate[40:44, 20:28] = 1.5
    candidate[42, 25] = 2.0
    worst = (Place(20, 40, 8, 4, "50 % brighter"),)
    page = show(case(Images(candidate, grey(1.0, size)), worst=worst))
    pixel(page, "candidate", 0, 0)
    button = page.get_by_role("button", name=re.compile("50 % brighter"))
    assert button.locator("canvas").count() == 2
    button.click()
    assert page.locator(".place").inner_text() == "x 25, y 42"
    frame = page.locator(".reference .frame").bounding_box()
    region = page.locator(".reference .region").bounding_box()
    assert region["width"] / frame["width"] == pytest.approx(0.5, abs=0.01)
    assert frame["y"] < region["y"] < frame["y"] + frame["height"] - region["height"]


def test_the_worst_pixel_is_one_that_is_no_number(show):
    candidate = grey(1.0)
    candidate[3, 5], candidate[4, 6] = 2.0, math.nan
    page = show(case(Images(candidate, grey(1.0)), worst=(Place(4, 2, 4, 4, "here"),)))
    pixel(page, "candidate", 0, 0)
    page.get_by_role("button", name="here").click()
    assert page.locator(".place").inner_text() == "x 6, y 4"
    assert read(page, "candidate") == ["NaN"] * 3


# Cases


def test_search_and_verdicts_hide_cases(show):
    cases = [
        case(None, "glass_ball", "agree", "all is well"),
        case(None, "glass_box", "differ", "too bright"),
        case(None, "mirror", "invalid", "one NaN"),
    ]
    page = show(*cases)

    def left():
        names = page.locator("section.case:visible h2").all_inner_texts()
        listed = page.locator("nav tbody tr:visible a").all_inner_texts()
        assert [name.split()[0] for name in names] == listed
        return listed

    assert left() == ["mirror", "glass_box", "glass_ball"]
    page.keyboard.press("/")
    page.keyboard.type("Glass")
    assert left() == ["glass_box", "glass_ball"]
    assert page.locator("#shown").inner_text() == "2 of 3"
    page.keyboard.type(" bright")
    assert left() == ["glass_box"]
    page.locator("#search").fill("")
    page.get_by_label("agree", exact=True).uncheck()
    assert left() == ["mirror", "glass_box"]
    page.locator("#search").fill("nothing like it")
    assert left() == []
    assert page.get_by_text("No case matches").is_visible()
    # Keys are letters while one types.
    page.locator("#search").fill("")
    page.locator("#search").press("f")
    assert page.locator("body").get_attribute("data-mode") == "side"


def test_next_and_previous_case(show):
    picture = Images(grey(0.25), grey(1.0))
    page = show(*(case(picture, f"scene_{k}") for k in range(4)), case(None, "last", "agree"))

    def focused():
        return page.evaluate("document.activeElement.closest('.case').id")

    visited = []
    for key in "nnnnnnpp":
        page.keyboard.press(key)
        visited.append(focused())
    assert visited == [f"case-{k}" for k in (1, 2, 3, 4, 5, 5, 4, 3)]
    assert page.locator("#case-3 h2").is_visible()
    page.locator("nav a", has_text="scene_0").click()
    assert page.locator("#case-1").bounding_box()["y"] > 0


def test_help(show):
    page = show()
    page.keyboard.press("?")
    assert page.locator("#help").is_visible()
    page.keyboard.press("2")
    assert page.locator("body").get_attribute("data-mode") == "side"
    page.keyboard.press("Escape")
    assert not page.locator("#help").is_visible()


def test_the_command_is_copied(show):
    command = "reference-rt compare 'a \"scene\" <1>.yaml'"
    page = show(case(None, again=command), permissions=["clipboard-read", "clipboard-write"])
    page.get_by_role("button", name="copy").click()
    page.get_by_role("button", name="copied").wait_for()
    assert page.evaluate("navigator.clipboard.readText()") == command


def test_cases_far_below_wait(show):
    picture = Images(grey(0.25), grey(1.0))
    page = show(*(case(picture, f"scene_{k}") for k in range(12)))
    pixel(page, "candidate", 0, 0)
    assert page.locator("#case-12").get_attribute("data-drawn") is None
    page.keyboard.press("+")
    page.locator("#case-12").scroll_into_view_if_needed()
    assert pixel(page, "candidate", 0, 0, 12) == (display(0.5),) * 3


# Odd pages


@pytest.mark.parametrize(
    "images",
    [
        Images(grey(1.0, (1, 1)), grey(0.5, (1, 1)), grey(0.0, (1, 1))),
        Images(grey(math.nan), grey(math.nan), grey(math.nan)),
        Images(grey(0.0), grey(0.0), grey(0.0)),
        Images(grey(-1.0), grey(1e300)),
        Images(grey(1.0, (3, 9)), grey(1.0, (300, 1))),
        Images(np.zeros((0, 0, 3)), np.zeros((0, 0, 3))),
    ],
    ids=["one pixel", "all NaN", "black", "extreme", "unlike sizes", "empty"],
)
def test_odd_pictures_do_no_harm(show, images):
    page = show(case(images, worst=(Place(0, 0, 1, 1, "here"),)))
    if not images.candidate.size:
        assert page.get_by_text("No pictures.").is_visible()
        return
    pixel(page, "candidate", 0, 0)
    page.get_by_role("button", name="here").click()
    assert page.locator(".place").inner_text() == "x 0, y 0"
    for key in "12345ffiow+-ccn":
        page.keyboard.press(key)


def test_pictures_that_lost_detail_say_where_they_are_read(show):
    noise = np.random.default_rng(0).lognormal(size=(2, 64, 64, 3))
    noise[0, 21, 10] = math.nan
    images = Images(*noise)
    # Room for what stands around the pictures, for half of them, and not for all.
    most = 100_000
    page = show(case(images, verdict="agree"), report={"most_bytes": most})
    factor = json.loads(page.locator("script.data").inner_text())["factor"]
    assert factor > 1
    assert page.get_by_text(f"the mean of {factor} × {factor}").is_visible()
    x, y = 10 // factor, 21 // factor
    assert pixel(page, "candidate", x, y) == MAGENTA
    point(page, x, y, size=(64 // factor, 64 // factor))
    assert page.locator(".place").inner_text() == (
        f"x {x * factor} to {x * factor + factor - 1}, y {y * factor} to {y * factor + factor - 1}"
    )


def test_without_a_script_tables_and_thumbnails_show(show):
    page = show(
        case(Images(grey(0.25), grey(1.0), grey(0.1)), again="again"), java_script_enabled=False
    )
    assert shown(page) == ["candidate", "reference", "difference"]
    assert page.locator("#case-1 .rungs").is_visible()
    assert not page.locator(".toolbar").is_visible()
    assert not page.get_by_role("button", name="copy").is_visible()
    assert page.get_by_text("Without JavaScript there are thumbnails only").is_visible()


def test_hostile_names_stay_text(show):
    nasty = "</script><script>alert(1)</script><img src=x onerror=alert(2)>\u2028"
    images = Images(grey(0.25), grey(1.0), grey(0.1))
    place = (Place(0, 0, 2, 2, nasty),)
    page = show(case(images, nasty, reason=nasty, sides=(nasty, nasty), worst=place, again=nasty))
    pixel(page, "candidate", 0, 0)
    page.keyboard.press("4")
    assert page.locator("#case-1 code").inner_text().strip() == nasty.strip()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [360, 1400])
def test_nothing_runs_out_of_the_window(show, scheme, width):
    images = Images(grey(0.25), grey(1.0), grey(0.1))
    page = show(
        case(images, "a_scene_with_a_rather_long_name" * 3, worst=(Place(0, 0, 2, 2, "here"),)),
        viewport={"width": width, "height": 800},
        color_scheme=scheme,
    )
    pixel(page, "candidate", 0, 0)
    for mode in "12345":
        page.keyboard.press(mode)
        too_wide = page.evaluate(
            """(width) => [...document.querySelectorAll("body *")]
                .filter((element) => element.getBoundingClientRect().right > width + 1)
                .map((element) => `${element.tagName}.${element.className}`)""",
            width,
        )
        assert page.evaluate("document.documentElement.scrollWidth") <= width, too_wide
    dark = page.evaluate("getComputedStyle(document.body).backgroundColor") != "rgb(255, 255, 255)"
    assert dark == (scheme == "dark")

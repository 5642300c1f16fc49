"""Finding a case on the page, and odd pages, in a real browser."""

import json
import math

import numpy as np
import pytest
from page_in_browser import case, display, grey, pixel, point, shown

from comparisons.report.thumbnails import MAGENTA
from comparisons.results.case import ImageRegion, Images


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
    page = show(case(images, worst=(ImageRegion(0, 0, 1, 1, "here"),)))
    if not images.candidate.size:
        assert page.get_by_text("No pictures.").is_visible()
        return
    pixel(page, "candidate", 0, 0)
    page.get_by_role("button", name="here").click()
    assert page.locator(".place").inner_text() == "x 0, y 0"
    for key in "123456ffiow+-ccn":
        page.keyboard.press(key)


def test_pictures_that_lost_detail_say_where_they_are_read(show):
    noise = np.random.default_rng(0).lognormal(size=(2, 64, 64, 3))
    noise[0, 21, 10] = math.nan
    images = Images(*noise)
    # Room for what stands around the pictures, for half of them, and not for all.
    most = 125_000
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
    assert shown(page) == ["candidate", "reference", "difference", "flip"]
    assert page.locator("svg.histogram").count() == 2
    assert page.locator("#case-1 .rungs").is_visible()
    assert not page.locator(".toolbar").is_visible()
    assert not page.get_by_role("button", name="copy").is_visible()
    assert page.get_by_text("Without JavaScript there are only thumbnails").is_visible()


@pytest.mark.slow
def test_hostile_names_stay_text(show):
    nasty = "</script><script>alert(1)</script><img src=x onerror=alert(2)>\u2028"
    images = Images(grey(0.25), grey(1.0), grey(0.1))
    place = (ImageRegion(0, 0, 2, 2, nasty),)
    page = show(case(images, nasty, reason=nasty, sides=(nasty, nasty), worst=place, again=nasty))
    pixel(page, "candidate", 0, 0)
    page.keyboard.press("4")
    assert page.locator("#case-1 code").inner_text().strip() == nasty.strip()


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [360, 1400])
def test_nothing_runs_out_of_the_window(show, scheme, width):
    images = Images(grey(0.25), grey(1.0), grey(0.1))
    page = show(
        case(
            images, "a_scene_with_a_rather_long_name" * 3, worst=(ImageRegion(0, 0, 2, 2, "here"),)
        ),
        viewport={"width": width, "height": 800},
        color_scheme=scheme,
    )
    pixel(page, "candidate", 0, 0)
    for mode in "123456":
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

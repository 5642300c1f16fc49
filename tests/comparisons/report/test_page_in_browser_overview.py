"""The table of cases, links to what is shown, and what pictures show."""

import numpy as np
import pytest
from page_in_browser import FOUR, PICTURES, case, display, drawn, measured, pixel, point, shown

from comparisons.results.case import Images


def names(page):
    """The cases in the order of the table, which is that of the sections."""
    listed = page.locator("nav tbody a").all_inner_texts()
    assert [s.split()[0] for s in page.locator("section.case h2").all_inner_texts()] == listed
    return "".join(listed)


def head(page, name):
    return page.locator("nav thead").get_by_role("button", name=name, exact=True)


def test_sorting(show):
    page = show(*FOUR, report={"walls": {"b": 3.0, "d": 20.0, "a": 100.0, "c": 1.0}})
    assert names(page) == "adcb"
    for column, expected in (("Scene", "abcd"), ("FLIP", "bcda"), ("Seconds", "cbda")):
        head(page, column).focus()
        page.keyboard.press("Enter")
        assert names(page) == expected
        (sorted_by,) = page.locator("nav [aria-sort=ascending]").all_inner_texts()
        assert sorted_by.startswith(column)
        assert page.locator("nav [aria-sort]").count() == 1
    head(page, "FLIP").click()
    head(page, "FLIP").click()
    assert names(page) == "dcba"  # what has no number stays last
    page.keyboard.press("n")
    assert page.evaluate("document.activeElement.closest('.case').dataset.name") == "d"


def test_thumbnails_in_the_table(show):
    page = show(*FOUR, case(None, "without"))
    images = page.locator("nav tbody img")
    assert images.count() == 4
    assert all(images.nth(k).evaluate("(image) => image.naturalWidth") == 12 for k in range(4))


def test_passing_cases_of_a_long_page_are_collapsed(show):
    many = [measured(f"s{k}", "agree" if k % 2 else "differ", 0.1, 1.0) for k in range(8)]
    page = show(*many)
    bodies = page.locator("section.case").evaluate_all(
        "(all) => all.map((one) => [one.dataset.verdict, one.querySelector('.body').open])"
    )
    assert all(is_open == (verdict == "differ") for verdict, is_open in bodies)
    assert page.locator("section.case", has_text="s1").locator(".headline").is_visible()
    section = page.locator("section.case[data-name=s1]")
    section.scroll_into_view_if_needed()
    assert section.get_attribute("data-drawn") is None
    section.locator("summary").first.focus()
    page.keyboard.press("Enter")
    page.wait_for_selector("section.case[data-name=s1][data-drawn]", state="attached")
    page.get_by_role("button", name="expand all").click()
    assert page.locator(".body:not([open])").count() == 0
    page.get_by_role("button", name="collapse all").click()
    assert page.locator(".body[open]").count() == 0
    page.locator("nav a", has_text="s3").click()
    assert page.locator("section.case[data-name=s3] .body").get_attribute("open") is not None


def fragment(page, expected):
    """The page's address, once it says so."""
    page.wait_for_function(
        """(expected) => {
            const found = Object.fromEntries(new URLSearchParams(location.hash.slice(1)));
            return Object.entries(expected).every(([k, v]) => found[k] === v);
        }""",
        arg=expected,
    )
    return page.evaluate("location.hash")


@pytest.fixture
def again(browser):
    """Open the page in a new window, with another fragment; it must not complain."""
    complaints, pages = [], []

    def opened(page, fragment):
        pages.append(browser.new_page(viewport={"width": 1200, "height": 900}))
        pages[-1].on("console", lambda message: complaints.append(message.text))
        pages[-1].on("pageerror", lambda error: complaints.append(str(error)))
        pages[-1].goto(page.url.partition("#")[0] + fragment)
        return pages[-1]

    yield opened
    for page in pages:
        page.close()
    assert complaints == []


def test_an_address_shows_the_same_again(show, again):
    odd = "odd & name=1 #ü"
    page = show(*FOUR, measured(odd, "agree", 0.1, 1.0))
    page.locator("nav a", has_text=odd).click()
    pixel(page, "candidate", 0, 0, 5)
    point(page, 7, 3, number=5)
    page.keyboard.press("5")
    page.locator("#which").select_option("z")
    page.locator("#which").blur()
    page.keyboard.press("+")
    page.locator("#colours").select_option("log")
    page.locator("#search").fill("odd")
    head(page, "Seconds").click()
    wanted = {"case": odd, "view": "single", "of": "z", "x": "7", "y": "3", "search": "odd"}
    there = fragment(page, wanted | {"stops": "1", "colours": "log", "sort": "seconds"})
    page = again(page, there)
    fragment(page, wanted)
    assert page.locator("body").get_attribute("data-mode") == "single"
    assert page.locator("body").get_attribute("data-which") == "z"
    assert page.locator("section.case:visible").count() == 1
    page.wait_for_function(
        "document.querySelector('section.case:not([hidden]) .place').textContent === 'x 7, y 3'"
    )
    assert page.locator("#stops-text").inner_text() == "+1"
    assert page.locator("#colours").input_value() == "log"


@pytest.mark.parametrize(
    "fragment_",
    ["#case=nothing", "#x=1&y=2", "#case=a&x=-5&y=1e9", "#view=<b>&of=?&sort=%", "#case-2", "#=&="],
)
def test_odd_addresses_do_no_harm(show, again, fragment_):
    page = again(show(*FOUR), fragment_)
    assert names(page) == "adcb"
    assert page.locator("body").get_attribute("data-mode") == "side"


def test_a_link_to_each_case(show):
    page = show(*FOUR)
    links = page.locator(".permalink").evaluate_all(
        "(all) => all.map((a) => a.getAttribute('href'))"
    )
    assert links == [f"#case={name}" for name in "adcb"]


# Pictures


def test_the_slider_is_dragged_in_the_picture(show):
    page = show(case(PICTURES))
    page.keyboard.press("4")
    pixel(page, "candidate", 0, 0)
    frame = page.locator("#case-1 .reference .frame")
    frame.scroll_into_view_if_needed()
    box = frame.bounding_box()
    middle = box["y"] + box["height"] / 2
    for start, end in ((0.5, 0.2), (0.9, 0.75), (0.75, 1.2)):
        page.mouse.move(box["x"] + start * box["width"], middle)
        page.mouse.down()
        page.mouse.move(box["x"] + end * box["width"], middle, steps=4)
        page.mouse.up()
        value = float(page.locator(".wipe input").input_value())
        assert value == pytest.approx(100.0 * min(end, 1.0), abs=1.0)
        page.mouse.move(box["x"], middle)  # without a button
        assert float(page.locator(".wipe input").input_value()) == value


@pytest.mark.cases(1)
@pytest.mark.parametrize("mode", "12345")
def test_the_name_of_a_picture_is_in_view(show, mode):
    page = show(case(PICTURES, sides=("theirs", "the baseline's")))
    pixel(page, "candidate", 0, 0)
    page.keyboard.press(mode)
    titles = {"candidate": "theirs", "reference": "the baseline's"}
    visible = shown(page)
    for kind in visible:
        tag = page.locator(f"#case-1 .{kind} .tag")
        assert tag.is_visible()
        assert tag.inner_text() == titles.get(kind, tag.inner_text()) != ""
    if mode == "4":
        left, right = (
            page.locator(f"#case-1 .{kind} .tag").bounding_box()
            for kind in ("candidate", "reference")
        )
        assert left["y"] == right["y"]
        # One name is at the left edge, the other at the right one.
        style = "(tag) => getComputedStyle(tag).textAlign"
        assert page.locator("#case-1 .reference .tag").evaluate(style) == "right"


@pytest.mark.slow
def test_tone_mapping(show):
    """In units of white: Reinhard's curve maps 4 to white; both are monotonic and start at 0."""
    ramp = np.linspace(0.0, 8.0, 96).reshape(8, 12)[..., None] * np.ones(3)
    page = show(case(Images(ramp, np.ones_like(ramp))))
    for colours, curve in (
        ("reinhard", lambda x: x * (1 + x / 16) / (1 + x)),
        ("filmic", lambda x: x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)),
    ):
        page.locator("#colours").select_option(colours)
        drawn(page, colours=colours)
        for x, y in ((0, 0), (3, 0), (1, 1), (0, 4), (11, 7)):
            expected = display(curve(ramp[y, x, 0]))
            assert abs(pixel(page, "candidate", x, y)[0] - expected) <= 1

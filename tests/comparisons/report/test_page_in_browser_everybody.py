"""The page for everybody: contrast, screen readers, the keyboard, paper, many cases."""

import json
from itertools import pairwise

import pytest
from page_in_browser import CONTRASTS, FOUR, PICTURES, case, measured, pixel


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_contrast(show, scheme):
    verdicts = ("agree", "differ", "inconclusive", "invalid", "not-comparable", "unchanged")
    cases = [measured(f"s{k}", verdict, 0.1, 1.0) for k, verdict in enumerate(verdicts)]
    page = show(*cases, color_scheme=scheme)
    page.get_by_role("button", name="expand all").click()
    assert page.evaluate(CONTRASTS) == []


def test_roles_for_screen_readers(show):
    page = show(*FOUR)
    for role in ("banner", "search", "navigation", "main"):
        assert page.get_by_role(role).count() == 1
    assert page.get_by_role("region").count() == len(FOUR)
    assert page.get_by_role("table").count() >= 2
    for kind in ("button", "link", "checkbox", "radio", "slider", "combobox", "searchbox", "img"):
        for one in page.get_by_role(kind).all():
            assert one.evaluate(
                """(e) => [e.ariaLabel, e.alt, e.textContent, e.labels?.[0]?.textContent]
                    .some((text) => text?.trim())"""
            )
    levels = page.locator("h1, h2, h3").evaluate_all(
        "(all) => all.filter((e) => e.checkVisibility()).map((e) => Number(e.tagName[1]))"
    )
    assert levels[0] == 1
    assert all(b - a <= 1 for a, b in pairwise(levels))


def test_everything_is_reached_by_the_tab_key(show):
    page = show(case(PICTURES, again="again"))
    pixel(page, "candidate", 0, 0)
    reached = set()
    for _ in range(60):
        page.keyboard.press("Tab")
        reached.add(
            page.evaluate(
                "(({activeElement: e}) => e.id || e.className || e.name || e.tagName)(document)"
            )
        )
    assert {"search", "expand", "stops", "colours", "permalink", "row", "copy live"} <= reached


def test_on_paper(show):
    page = show(*FOUR)
    pixel(page, "candidate", 0, 0)
    page.emulate_media(media="print")
    assert not page.locator(".toolbar").is_visible()
    assert not page.locator("#case-1 .reading").is_visible()
    assert page.locator("nav table").is_visible()
    assert page.locator("#case-1 .candidate").is_visible()
    assert page.evaluate("getComputedStyle(document.body).color") == "rgb(0, 0, 0)"
    assert len(page.pdf()) > 1000


def test_numbers_are_tables(show):
    one = case(PICTURES)
    numbers = {"rays": 7, "bias": {"R": 0.5, "G": 0.25, "B": 1.0}, "tiles": {"differ": 3}}
    rung = one.rungs[0].__class__("geometry", "differ", "why", numbers)
    page = show(type(one)(**{**vars(one), "rungs": (rung,)}))
    rows = page.locator(".rungs .numbers tr").all_inner_texts()
    assert [row.split() for row in rows] == [
        ["rays", "7"],
        ["bias", "0.5", "0.25", "1"],
        ["tiles"],
        ["differ", "3"],
    ]


@pytest.mark.slow
def test_a_page_of_64_cases_is_light(show):
    """In what it does at the start: no picture is decoded that is far from the window, and no
    time is spent on collapsed cases."""
    many = [measured(f"s{k}", "agree" if k else "differ", 0.1, 1.0) for k in range(64)]
    page = show(*many)
    assert page.locator("canvas").count() == 0
    page.locator("nav a").first.click()
    pixel(page, "candidate", 0, 0)
    assert page.locator("[data-drawn]").count() == 1
    assert page.locator("canvas").count() <= 4
    assert json.loads(page.locator("#case-1").get_attribute("data-drawn"))["stops"] == 0

"""The page for everybody: contrast, screen readers, the keyboard, paper, many cases."""

import json
from dataclasses import replace
from itertools import pairwise

import pytest
from page_in_browser import CONTRASTS, FOUR, PICTURES, case, measured, pixel

from comparisons.report import write_report
from comparisons.results.case import Cause, RungResult

NUMBERS = {
    "relative_bias": {"R": 0.01, "G": 0.011, "B": 0.012},
    "detectable_bias": {"R": 0.002, "G": 0.0035, "B": 0.001},
    "max_shading_normal_error_over_bound": 0.25,
    "tiles": {"differ": 3, "tested": 64, "worst_bias": -0.12, "worst_half_width": 0.021},
    "pixels": {"differ": 0, "tested": 16384, "median_detectable_bias": 0.5},
}


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
    page = show(case(PICTURES, again="again"), case(None, "other"))
    pixel(page, "candidate", 0, 0)
    reached = set()
    for _ in range(60):
        page.keyboard.press("Tab")
        reached.add(
            page.evaluate(
                "(({activeElement: e}) => e.id || e.className || e.name || e.tagName)(document)"
            )
        )
    assert {"search", "expand", "stops", "colours", "permalink live", "row", "copy live"} <= reached


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


@pytest.mark.parametrize("count", [1, 5])
def test_pages_of_one_case_and_of_a_suite(tmp_path, check_page, count):
    name = "a_scene_with_a_rather_long_name_" * 3
    rung = RungResult("statistics", "differ", "why", NUMBERS)
    one = case(PICTURES, name, reason="statistics: why", again=f"reference-rt compare {name}.yaml")
    one = replace(one, rungs=(*one.rungs, rung), cause=Cause("gain", "by 2 %", 0.9))
    cases = [one, *(measured(f"{name}{k}", "agree", 0.1, 1.0, None) for k in range(count - 1))]
    more = {} if count == 1 else {"title": "standard", "not_run": {f"other_{name}": "no file"}}
    write_report(tmp_path / "page.html", cases, {"versions": {"numpy": "2.4"}}, **more)
    check_page(tmp_path / "page.html")

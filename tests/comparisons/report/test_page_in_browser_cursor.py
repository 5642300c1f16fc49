"""The page's cursor, its zoom, and its links to places, in a real browser."""

import math
import re

import numpy as np
import pytest
from page_in_browser import SIZE, case, centre, grey, pixel, point, read, visible_part

from comparisons.results.case import ImageRegion, Images


def test_pixels_read_what_the_arrays_hold(show):
    rng = np.random.default_rng(3)
    candidate, reference, error = rng.lognormal(sigma=2.0, size=(3, SIZE[1], SIZE[0], 3))
    page = show(case(Images(candidate, reference, error)))
    for kind, x, y in (("candidate", 0, 0), ("reference", 11, 7), ("difference", 4, 6)):
        point(page, x, y, kind)
        assert page.locator(".place").inner_text() == f"x {x}, y {y}"
        difference = candidate[y, x] - reference[y, x]
        # Rounding to the seven digits shown, and to float32; z has two digits.
        rows = {
            "candidate": (candidate[y, x], 0.5e-6 + 2**-24),
            "reference": (reference[y, x], 0.5e-6 + 2**-24),
            "difference": (difference, 0.5e-6 + 2**-24),
            "z": (difference / error[y, x], 0.5e-1 + 2**-11),
        }
        for row, (values, tolerance) in rows.items():
            texts = [text.replace("−", "-") for text in read(page, row)]
            assert [float(text) for text in texts] == pytest.approx(values, rel=tolerance)


def test_the_cursor_moves_by_keys_in_all_pictures_at_once(show):
    candidate = np.arange(96.0).reshape(8, 12)[..., None] * np.ones(3)
    page = show(case(Images(candidate, grey(1.0)), trace="reference-rt trace a_b/c.yaml"))
    pixel(page, "candidate", 0, 0)
    assert not page.locator(".trace").is_visible()
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
    told = page.locator(".trace code").inner_text()
    assert told == "reference-rt trace a_b/c.yaml --pixel 11,3"
    for kind in ("candidate", "reference", "difference"):
        frame = page.locator(f".{kind} .frame").bounding_box()
        mark = page.locator(f".{kind} .cursor").bounding_box()
        assert (mark["x"] - frame["x"]) / frame["width"] == pytest.approx(11 / 12, abs=1e-3)
        assert (mark["y"] - frame["y"]) / frame["height"] == pytest.approx(3 / 8, abs=1e-3)


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
    worst = (ImageRegion(20, 40, 8, 4, "50 % brighter"),)
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
    page = show(case(Images(candidate, grey(1.0)), worst=(ImageRegion(4, 2, 4, 4, "here"),)))
    pixel(page, "candidate", 0, 0)
    page.get_by_role("button", name="here").click()
    assert page.locator(".place").inner_text() == "x 6, y 4"
    assert read(page, "candidate") == ["NaN"] * 3

"""The page in a real browser, opened from disk: what is drawn, and the views."""

import io
import math
from importlib.resources import files

import numpy as np
import pytest
from page_in_browser import case, display, drawn, grey, pixel, point, read, shown
from PIL import Image

from comparisons.report.pictures_data import as_json, pack, unpack
from comparisons.report.thumbnails import MAGENTA, RED
from comparisons.results.case import Images

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
                const {{ others, ...pictures }} = await unpack(JSON.parse(data));
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
    candidate[7, 1] += 5e-7  # what float32 makes of 1, and noise below it
    error[7, 1] = 1e-9
    page = show(case(Images(candidate, grey(1.0), error)))
    assert pixel(page, "z", 0, 0) == (255, 255, 255)
    halfway = tuple(round(255 + (end - 255) / 2) for end in (33, 102, 172))
    assert np.abs(np.subtract(pixel(page, "z", 3, 2), halfway)).max() <= 8
    assert pixel(page, "z", 5, 4) == RED
    # Without noise, any difference is too large, and none is none.
    assert pixel(page, "z", 7, 6) == RED
    assert pixel(page, "z", 6, 6) == pixel(page, "z", 1, 7) == (255, 255, 255)
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


def test_layers(show):
    normals, distances = grey(0.0), grey(4.0)
    normals[2, 3] = 0.0, 1.0, -0.5
    layers = {"normal": (normals, grey(0.0)), "distance": (distances, grey(2.0))}
    page = show(case(Images(grey(0.25), grey(1.0), grey(0.1), layers=layers)))
    pixel(page, "candidate", 0, 0)
    point(page, 3, 2)
    page.locator(".layer").select_option("normal")
    page.get_by_text("grey is 0").wait_for()
    assert pixel(page, "candidate", 3, 2) == (128, 255, 64)
    assert read(page, "candidate") == ["0", "1", "−0.5"]
    assert shown(page) == ["candidate", "reference", "difference"]
    page.locator(".layer").select_option("distance")
    page.get_by_text("White is a distance of 2").wait_for()
    assert read(page, "difference") == ["2"] * 3
    page.locator(".layer").select_option("")
    page.get_by_text("White is radiance 1 W").wait_for()
    assert read(page, "candidate") == ["0.25"] * 3
    assert shown(page) == ["candidate", "reference", "difference", "z", "flip"]


# Views


def test_the_views(show):
    page = show(case(Images(grey(0.25), grey(1.0), grey(0.1))))
    pixel(page, "z", 0, 0)
    assert shown(page) == ["candidate", "reference", "difference", "z", "flip"]
    page.keyboard.press("2")
    assert shown(page) == ["candidate"]
    page.keyboard.press("f")
    assert shown(page) == ["reference"]
    page.keyboard.press("f")
    assert shown(page) == ["candidate"]
    page.keyboard.press("4")
    assert shown(page) == ["candidate", "reference"]
    page.keyboard.press("6")
    assert shown(page) == ["candidate", "reference"]
    page.keyboard.press("5")
    for kind in ("reference", "difference", "z", "flip", "candidate"):
        page.keyboard.press("f")
        assert shown(page) == [kind]
        drawing = "img" if kind == "flip" else "canvas"
        style = page.evaluate(f"getComputedStyle(document.querySelector('.{kind} {drawing}'))")
        assert style["imageRendering"] == "pixelated"
    page.locator("#which").select_option("z")
    assert shown(page) == ["z"]
    page.get_by_label("side by side", exact=True).check()
    assert len(shown(page)) == 5
    page.keyboard.press("f")
    assert page.get_by_label("flip", exact=True).is_checked()


def test_blinking(show):
    page = show(case(Images(grey(0.25), grey(1.0))))
    page.keyboard.press("3")
    for kind in ("reference", "candidate"):
        # Read with the state itself: half a second later it is the other one.
        seen = page.wait_for_function(
            """(kind) => document.body.dataset.which === kind
                && [...document.querySelectorAll("#case-1 .row figure")]
                    .filter((e) => e.checkVisibility()).map((e) => e.dataset.kind)""",
            arg=kind,
        )
        assert seen.json_value() == [kind]
    page.keyboard.press("1")
    assert shown(page) == ["candidate", "reference", "difference", "flip"]


def test_a_single_view_says_what_a_case_lacks(show):
    page = show(case(Images(grey(0.25), grey(1.0, (3, 3)))))
    page.keyboard.press("5")
    page.locator("#which").select_option("difference")
    assert shown(page) == []
    assert page.get_by_text("This case has no picture of this kind").is_visible()


@pytest.mark.slow
def test_the_slider_and_the_onion_skin(show):
    page = show(case(Images(grey(0.25), grey(1.0))))
    pixel(page, "candidate", 0, 0)
    dark, white = display(0.25), 255
    for key, expected in (("4", (dark, white)), ("6", (round(0.25 * dark + 0.75 * white),) * 2)):
        page.keyboard.press(key)
        page.locator(".wipe input").fill("25")
        page.locator("h1").hover()
        picture = Image.open(io.BytesIO(page.locator("#case-1 .reference .frame").screenshot()))
        row = picture.height // 2
        found = [picture.getpixel((int(f * picture.width), row))[0] for f in (0.2, 0.3)]
        assert np.abs(np.subtract(found, expected)).max() <= 1

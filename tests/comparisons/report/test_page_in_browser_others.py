"""Pictures of more than two renderers on the page: any two of them side by side, by keys."""

import numpy as np
import pytest
from page_in_browser import SIZE, case, grey, pixel, point, read, shown

from comparisons.report.pictures_data import pack, unpack
from comparisons.report.thumbnails import BLUE, RED
from comparisons.results.case import Images
from comparisons.results.stored_case import read_case, write_case

CANDIDATE, REFERENCE, ERROR, THIRD, FOURTH = np.random.default_rng(3).lognormal(
    size=(5, SIZE[1], SIZE[0], 3)
)
IMAGES = Images(CANDIDATE, REFERENCE, ERROR, others={"<Cycles>'": THIRD, "POV-Ray's": FOURTH})
EVERY = {"ours": CANDIDATE, "Mitsuba's": REFERENCE, "<Cycles>'": THIRD, "POV-Ray's": FOURTH}

# Rounding to the seven digits shown, and to float32 of two pictures, whose difference is smaller.
DIGITS = {"rel": 0.5e-6 + 2**-24, "abs": 2**-23 * max(float(p.max()) for p in EVERY.values())}


def titles(page):
    return [
        page.locator(f"#case-1 .{kind} .tag").inner_text() for kind in ("candidate", "reference")
    ]


def drawn_with(page, left, right):
    page.wait_for_function(
        """([left, right]) => {
            const tag = (kind) => document.querySelector(`#case-1 .${kind} .tag`).textContent;
            return tag("candidate") === left && tag("reference") === right;
        }""",
        arg=[left, right],
    )


def numbers(page, row):
    return [float(text.replace("−", "-")) for text in read(page, row)]


def check_values(page, left, right, x=4, y=6):
    """What is read of both pictures and of their difference, and of the other two."""
    drawn_with(page, left, right)
    one, two = EVERY[left][y, x], EVERY[right][y, x]
    assert numbers(page, "candidate") == pytest.approx(one, **DIGITS)
    assert numbers(page, "reference") == pytest.approx(two, **DIGITS)
    assert numbers(page, "difference") == pytest.approx(one - two, **DIGITS)
    rows = page.locator("#case-1 [data-row=other]:not([hidden])")
    found = {row.locator("th").inner_text(): row for row in rows.all()}
    assert set(found) == set(EVERY) - {left, right}
    for whose, row in found.items():
        texts = [text.replace("−", "-") for text in row.locator("td").all_text_contents()]
        assert [float(text) for text in texts] == pytest.approx(EVERY[whose][y, x], **DIGITS)
    assert page.locator("#case-1 .difference .tag").inner_text() == f"{left} − {right}"


def test_keys_lead_through_every_pair(show):
    page = show(case(IMAGES))
    point(page, 4, 6)
    check_values(page, "ours", "Mitsuba's")
    pairs = {("ours", "Mitsuba's")}
    for key in "aabaababaabbaa":
        before = titles(page)
        page.keyboard.press(key)
        page.wait_for_function(
            """(before) => ["candidate", "reference"].some((kind, k) =>
                document.querySelector(`#case-1 .${kind} .tag`).textContent !== before[k])""",
            arg=before,
        )
        page.wait_for_timeout(30)  # decoded already: drawn in the next task
        check_values(page, *titles(page))
        pairs.add(tuple(titles(page)))
    assert len(pairs) == 12


def test_noise_is_known_of_the_pair_that_was_judged_alone(show):
    page = show(case(IMAGES))
    point(page, 4, 6)
    z = (CANDIDATE - REFERENCE)[6, 4] / ERROR[6, 4]
    assert numbers(page, "z") == pytest.approx(z, rel=0.5e-1 + 2**-11)
    assert shown(page) == ["candidate", "reference", "difference", "z", "flip"]
    left, right = page.locator("#case-1 .side").all()
    left.select_option("POV-Ray's")
    drawn_with(page, "POV-Ray's", "Mitsuba's")
    page.wait_for_function("() => document.querySelector('#case-1 .z').hidden")
    assert shown(page) == ["candidate", "reference", "difference"]
    assert read(page, "z") == ["–"] * 3
    # What stands on the other side changes places; of the judged pair turned round, z is known.
    left.select_option("Mitsuba's")
    drawn_with(page, "Mitsuba's", "POV-Ray's")
    right.select_option("ours")
    drawn_with(page, "Mitsuba's", "ours")
    page.wait_for_function("() => !document.querySelector('#case-1 .z').hidden")
    assert numbers(page, "z") == pytest.approx(-z, rel=0.5e-1 + 2**-11)


def test_the_difference_of_a_pair_has_its_own_scale(show):
    third = grey(1.0)
    third[2:4, 3] = (5.0, 1.0, 0.0), (1.0, -7.0, 1.0)
    page = show(case(Images(grey(1.0), grey(1.0), others={"a third's": third})))
    point(page, 3, 2)
    page.keyboard.press("a")
    drawn_with(page, "a third's", "Mitsuba's")
    page.wait_for_timeout(30)
    # Two pixels of 96 differ, more than 0.5 %: the second largest size, 4, is full red.
    assert page.locator("#case-1 .difference .high").inner_text() == "+4"
    assert pixel(page, "difference", 3, 2) == RED
    assert pixel(page, "difference", 3, 3) == BLUE
    assert pixel(page, "difference", 0, 0) == (255, 255, 255)


def test_a_link_keeps_the_pair(show):
    page = show(case(IMAGES))
    point(page, 4, 6)
    page.keyboard.press("b")
    drawn_with(page, "ours", "<Cycles>'")
    page.wait_for_function("() => location.hash.includes('pair=0%2C2')")
    link = page.evaluate("() => location.hash")
    page.keyboard.press("a")
    drawn_with(page, "Mitsuba's", "<Cycles>'")
    page.wait_for_function("(link) => location.hash !== link", arg=link)
    page.evaluate("(link) => { location.hash = link; }", link)
    drawn_with(page, "ours", "<Cycles>'")
    for wrong in ("pair=0,9", "pair=1,1", "pair=x", "pair=0"):
        page.evaluate("(wrong) => { location.hash = `case=box&${wrong}`; }", wrong)
        page.wait_for_timeout(50)
        assert titles(page) == ["ours", "<Cycles>'"]


def test_a_page_of_two_renderers_has_no_choice(show):
    page = show(case(Images(grey(0.25), grey(1.0))))
    point(page, 1, 1)
    page.keyboard.press("a")
    assert titles(page) == ["ours", "Mitsuba's"]
    assert page.locator(".side").count() == 0


def test_a_layer_is_of_the_judged_pair(show):
    layers = {"depth": (grey(2.0), grey(3.0))}
    page = show(case(Images(CANDIDATE, REFERENCE, ERROR, {"a third's": THIRD}, layers)))
    point(page, 4, 6)
    page.keyboard.press("a")
    drawn_with(page, "a third's", "Mitsuba's")
    page.locator(".layer").select_option("depth")
    drawn_with(page, "ours", "Mitsuba's")
    first = "document.querySelector('[data-row=candidate] td').textContent"
    page.wait_for_function(f"() => {first} === '2'")
    page.keyboard.press("a")
    assert titles(page) == ["ours", "Mitsuba's"]
    page.locator(".side").first.select_option("a third's")
    drawn_with(page, "a third's", "Mitsuba's")
    assert page.locator(".layer").input_value() == ""
    page.wait_for_function(f"() => {first} !== '2'")
    assert numbers(page, "candidate") == pytest.approx(THIRD[6, 4], **DIGITS)


def test_without_a_script_there_are_thumbnails(show):
    page = show(case(IMAGES), java_script_enabled=False)
    alts = page.locator(".pictures.plain img").evaluate_all("all => all.map((one) => one.alt)")
    assert [alt.partition(", −")[0] for alt in alts] == [
        f"box: {title}"
        for whose in ("<Cycles>'", "POV-Ray's")
        for title in (whose, f"ours − {whose}", f"Mitsuba's − {whose}")
    ]
    assert page.locator(".pictures.plain").is_visible()


def test_other_pictures_are_stored_and_packed(tmp_path):
    for factor in (1, 2):
        others = unpack(pack(IMAGES, factor)).others
        for found, given in zip(others, IMAGES.others.values(), strict=True):
            blocks = given.reshape(SIZE[1] // factor, factor, SIZE[0] // factor, factor, 3)
            np.testing.assert_allclose(found, blocks.mean((1, 3)), rtol=2**-11)
    write_case(tmp_path, case(IMAGES))
    found = read_case(tmp_path).images.others
    assert list(found) == list(IMAGES.others)
    for whose, picture in found.items():
        np.testing.assert_array_equal(picture, IMAGES.others[whose].astype(np.float32))


@pytest.mark.parametrize("width", [400, 1400])
def test_small_differences_have_room(show, width):
    """Of some 1e-6, of values with seven digits."""
    beside = CANDIDATE + np.array([-1.3e-6, 1.1e-6, 2.7e-6])
    images = Images(CANDIDATE, beside, others={"POV-Ray's": beside[::-1]})
    page = show(case(images), viewport={"width": width, "height": 900})
    point(page, 3, 2)
    assert all("e-" in text.replace("−", "-") for text in read(page, "difference"))
    too_wide = page.evaluate(
        """() => {
            const right = (element) => element.getBoundingClientRect().right;
            const box = document.querySelector("#case-1 .pictures");
            const shown = [...box.querySelectorAll(".pixel :is(td, th), .scale span")];
            const scales = [...box.querySelectorAll(".scale")].filter((s) => s.offsetWidth);
            const ramp = (scale) => scale.querySelector(".ramp, .viridis").offsetWidth;
            return [
                ...shown.filter((e) => right(e) > right(box)).map((e) => e.textContent),
                ...scales.filter((s) => ramp(s) < 40 || s.scrollWidth > s.offsetWidth),
            ];
        }"""
    )
    assert too_wide == []

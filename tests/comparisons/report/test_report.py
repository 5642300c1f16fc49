"""The page, read back with the standard library's parser; a browser opens it elsewhere."""

import base64
import hashlib
import math
import re

import numpy as np
import pytest
from report_page import NASTY, PROVENANCE, Page, case, noise

from comparisons.compare.notebook import NotebookCase
from comparisons.report import write_report
from comparisons.report.biases import biases_of
from comparisons.report.pictures_data import unpack
from comparisons.report.values import shown
from comparisons.results.case import Case, Cause, ImageRegion, Images
from comparisons.statistics import compare


@pytest.fixture
def page(tmp_path):
    def write(*cases, **options):
        path = tmp_path / "report.html"
        write_report(path, cases, PROVENANCE, **options)
        text = path.read_text(encoding="utf-8")
        return Page(text), text

    return write


# The page


def test_the_page_asks_for_nothing_outside(page):
    images = Images(np.ones((4, 4, 3)), np.ones((4, 4, 3)))
    parsed, text = page(case("agree", images=images), case("differ"))
    assert parsed.open == []
    assert parsed.references
    assert all(r.startswith(("data:image/png;base64,", "#")) for r in parsed.references)
    assert not re.search(r"https?:|url\(|@import|\bfetch\(|\beval\b|innerHTML", text)
    assert "default-src 'none'" in text
    assert not {"link", "iframe", "object"} & set(parsed.tags)


def test_only_the_page_s_own_script_may_run(page):
    parsed, text = page(case("agree", images=Images(noise((2, 2)), noise((2, 2)))))
    (module,) = [script for type_, script in parsed.scripts if type_ == "module"]
    digest = base64.b64encode(hashlib.sha256(module.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}';" in text
    assert parsed.handlers == []


def test_failures_come_first(page):
    given = ["agree", "reference-limited", "inconclusive", "not-comparable", "differ", "invalid"]
    parsed, text = page(*map(case, given))
    expected = ["invalid", "differ", "inconclusive", "not-comparable", "reference-limited", "agree"]
    assert [title.split()[0] for title in parsed.cases] == [f"scene-{v}" for v in expected]
    # The verdict is a word beside the name, not only a colour.
    assert [title.split()[-1] for title in parsed.cases] == expected
    assert "6 cases" in text


def test_what_others_wrote_is_escaped(page):
    images = Images(noise((3, 3)), noise((3, 3), 1), noise((3, 3), 2))
    nasty = case(
        "differ",
        NASTY,
        images,
        {NASTY: NASTY},
        sides=(NASTY, NASTY),
        cause=Cause(NASTY, NASTY, 0.5),
        worst=(ImageRegion(0, 0, 1, 1, NASTY),),
        left_out=(NASTY,),
        again=NASTY,
    )
    parsed, text = page(nasty)
    assert parsed.open == []
    assert [type_ for type_, _ in parsed.scripts] == ["application/json", "module"]
    assert NASTY not in text
    assert "alert('x')" not in text
    assert parsed.cases[0].startswith(NASTY)


def test_a_name_that_is_not_unicode_does_not_stop_the_page(page):
    assert page(case("agree", scene="odd\udcff"))[0].cases[0].startswith("odd")


def test_everything_a_case_says_is_there(page):
    told = case(
        "differ",
        cause=Cause("lost light", "r = 0.97", 0.94),
        worst=(ImageRegion(8, 16, 4, 2, "z = 14"),),
        left_out=("mirrors: none",),
        again="reference-rt compare x.yaml",
    )
    _, text = page(told)
    for words in (
        "Likeliest cause: lost light; ",
        "<b>lost light:</b>",
        "r = 0.97",
        "4 × 2 pixels at (8, 16)",
        "z = 14",
        "mirrors: none",
        "<code>reference-rt compare x.yaml</code>",
        "why differ",
        "0.0625",
        "note",
    ):
        assert words in text, words


def test_the_numbers_of_the_statistics_are_a_table_and_the_paragraph_is_the_rungs(page):
    rung = compare(noise((4, 32, 32)), noise((4, 32, 32), 1))
    reason = f"statistics: {rung.reason}"
    told = Case("a", rung.status, reason, (rung,), None, {}, sides=("ours", "Mitsuba's"))
    _, text = page(told)
    notebook = NotebookCase("a", rung.status, rung.reason, (rung,), None, {})._repr_html_()
    table = biases_of(told)
    for cell in (cell for row in (table.head, *table.cells) for cell in row):
        assert f">{cell}</t" in notebook
        assert f">{cell.replace(' %', chr(160) + '%')}</t".lower() in text.lower()
    assert text.count(rung.reason) == 1
    assert f"<summary>{rung.reason.partition('; ')[0]}</summary>" in notebook


def test_the_difference_is_signed_and_bad_pixels_are_magenta(page):
    candidate, reference = np.full((4, 4, 3), 0.5), np.full((4, 4, 3), 0.5)
    candidate[0, 0, 1] += 0.1
    candidate[0, 1, 2] -= 0.1
    candidate[3, 3, 0] = np.nan
    reference[3, 2, 0] = np.inf
    parsed, text = page(case("invalid", images=Images(candidate, reference)))
    difference = parsed.pixels(2)
    assert tuple(difference[0, 0]) == (178, 24, 43)
    assert tuple(difference[0, 1]) == (33, 102, 172)
    assert tuple(difference[2, 2]) == (255, 255, 255)
    magenta = [np.argwhere((parsed.pixels(i) == (255, 0, 255)).all(-1)).tolist() for i in range(3)]
    assert magenta == [[[3, 3]], [[3, 2]], [[3, 2], [3, 3]]]
    assert "2 pixels not finite (magenta)" in text
    assert "+0.1</span>" in text


def test_a_bad_pixel_shows_in_the_thumbnail_of_a_large_picture(page):
    candidate = np.ones((100, 300, 3))
    candidate[57, 123, 1] = -np.inf
    parsed, _ = page(case("invalid", images=Images(candidate, np.ones_like(candidate))))
    assert parsed.pixels(0).shape == (20, 60, 3)
    assert tuple(parsed.pixels(0)[57 // 5, 123 // 5]) == (255, 0, 255)


def test_equal_pictures_and_pictures_of_unlike_size(page):
    picture = noise((3, 5))
    parsed, text = page(case("agree", images=Images(picture, picture)))
    assert "equal everywhere" in text
    assert (parsed.pixels(2) == 255).all()
    assert (parsed.pixels(0) == parsed.pixels(1)).all()
    nothing = np.full((3, 5, 3), math.nan)
    assert "equal everywhere" not in page(case("invalid", images=Images(nothing, nothing)))[1]
    _, text = page(case("invalid", images=Images(picture, picture[1:])))
    assert "differ in size" in text


@pytest.mark.parametrize("value", [0.0, math.nan, -math.inf, 1e300, 5e-324, -1.0])
def test_odd_pictures(page, value):
    images = Images(np.full((1, 1, 3), value), np.full((1, 1, 3), -value), np.zeros((1, 1, 3)))
    parsed, _ = page(case("invalid", images=images))
    back = unpack(parsed.data[0])
    np.testing.assert_allclose(back.candidate, images.candidate, rtol=2**-10)
    np.testing.assert_allclose(back.reference, images.reference, rtol=2**-11)


def test_a_picture_without_pixels_is_none(page):
    nothing = np.empty((0, 4, 3))
    assert "No pictures." in page(case("invalid", images=Images(nothing, noise((4, 4)))))[1]


def test_a_run_without_cases_still_has_a_page(page):
    assert "0 cases" in page()[1]


def test_a_large_run_stays_within_the_bound_and_says_what_it_lost(page):
    images = Images(noise((64, 64)), noise((64, 64), 1), noise((64, 64), 2))
    cases = [case("agree", images=images)] * 6 + [case("differ", images=images)]
    whole, text = page(*cases)
    assert [data["factor"] for data in whole.data] == [1] * 7
    assert "the mean of" not in text
    most = 3 * len(text) // 4
    parsed, text = page(*cases, most_bytes=most)
    assert len(text.encode()) < most
    assert [data["factor"] for data in parsed.data[:1]] == [1]
    assert any(data["factor"] == 2 for data in parsed.data[1:])
    assert "each pixel here is the mean of 2 × 2" in text
    _, text = page(*cases, most_bytes=1000)
    assert "there are only thumbnails here" in text


class Speechless:
    def __str__(self):
        raise RuntimeError("no words")


def test_a_failed_write_leaves_the_former_page(tmp_path):
    path = tmp_path / "report.html"
    write_report(path, [case("agree")], PROVENANCE)
    before = path.read_bytes()
    with pytest.raises(RuntimeError, match="no words"):
        write_report(path, [case("agree", numbers={"x": Speechless()})], PROVENANCE)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("value", "name", "text"),
    [
        (0.0123456, "", "0.01235"),
        (-1.5e-7, "", "−1.5 × 10⁻⁷"),
        (0.00123, "relative_bias", "0.123 %"),
        ({"R": 0.5, "G": None}, "p_value", "R 0.5, G –"),
        (np.int64(65536), "", "65,536"),
        (np.bool_(True), "", "yes"),
        (math.nan, "", "undefined"),
        (-math.inf, "mean_bias", "−∞"),
        (np.arange(9), "", "0, 1, 2, 3, 4, 5, 6, 7, … (9 in all)"),
        ("worst", "", "worst"),
    ],
)
def test_values_for_people(value, name, text):
    assert shown(value, name) == text

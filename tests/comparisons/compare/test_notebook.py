"""A case in a notebook, and `comparisons.compare` as what a user calls."""

import importlib
import math

import numpy as np
import pytest

import comparisons
from comparisons.compare.notebook import NotebookCase, difference
from comparisons.report.thumbnails import BLUE, RED
from comparisons.results.case import Images, Metrics, RungResult
from reference_rt import Scene, SceneError

NASTY = "<script>alert(1)</script>"


def grey(value, size=(4, 6)):
    return np.full((*size, 3), value)


def case(images, scene="box", verdict="differ", **more):
    metrics = Metrics(0.9, math.nan, 30.0, 0.5, 0.25, (0.0, 0.0, -0.01), 0)
    rungs = (RungResult("geometry", "agree", "holds", {"rays": 7}),)
    return NotebookCase(scene, verdict, "why", rungs, metrics, {}, images, **more)


def test_verdict_pictures_numbers_and_rungs():
    page = case(Images(grey(0.25), grey(1.0), grey(0.1)))._repr_html_()
    assert page.count("<img") == 3
    for word in ("differ", "box", "geometry", "holds", "SSIM 0.9", "standard errors"):
        assert word in page
    assert page.count("<div") == page.count("</div>") == 1


@pytest.mark.parametrize(
    ("images", "count"),
    [
        (None, 0),
        (Images(np.zeros((0, 0, 3)), np.zeros((0, 0, 3))), 0),
        (Images(grey(1.0), grey(1.0, (2, 2))), 2),
        (Images(grey(math.nan), grey(math.inf)), 3),
        (Images(grey(0.0), grey(0.0), grey(0.0)), 3),
    ],
    ids=["none", "empty", "sizes", "not finite", "black"],
)
def test_odd_pictures(images, count):
    assert case(images)._repr_html_().count("<img") == count


def test_names_are_text():
    page = case(None, NASTY, sides=(NASTY, NASTY))._repr_html_()
    assert "<script" not in page


def test_the_difference_in_standard_errors():
    candidate, error = grey(1.0), grey(0.1)
    candidate[0, 0, 1], candidate[1, 1, 2], candidate[2, 2, 0] = 2.0, 0.0, math.nan
    title, pixels = difference(Images(candidate, grey(1.0), error))
    assert title == "difference, −5 to +5 standard errors"
    assert tuple(pixels[0, 0]) == RED
    assert tuple(pixels[1, 1]) == BLUE
    assert tuple(pixels[2, 2]) == (255, 0, 255)
    assert tuple(pixels[3, 3]) == (255, 255, 255)


def test_the_difference_without_noise_spans_its_largest():
    candidate = grey(1.0)
    candidate[0, 0], candidate[0, 1] = 3.0, 0.0
    title, pixels = difference(Images(candidate, grey(1.0)))
    assert "−2 to +2" in title
    assert tuple(pixels[0, 0]) == RED
    halfway = [255 + (end - 255) / 2 for end in BLUE]
    np.testing.assert_allclose(pixels[0, 1], halfway)


def test_the_text_of_a_case_is_one_short_line():
    text = repr(case(Images(grey(0.25), grey(1.0))))
    assert text.startswith("<Case box: differ: ")
    assert len(text) < 200
    assert "\n" not in text


def test_the_package_is_called_and_imported():
    assert callable(comparisons.compare)
    budget = importlib.import_module("comparisons.compare.budget")
    assert comparisons.compare.budget is budget
    with pytest.raises(AttributeError, match="no attribute 'compere'"):
        _ = comparisons.compere


def test_settings_are_checked(tmp_path):
    with pytest.raises(SceneError, match="spp"):
        comparisons.compare(Scene(), spp=0)
    with pytest.raises(SceneError, match="cannot be read"):
        comparisons.compare(tmp_path / "nothing.yaml")


def test_a_page(tmp_path, monkeypatch):
    monkeypatch.setattr("comparisons.compare.notebook.provenance", lambda: {"date": "today"})
    case(Images(grey(0.25), grey(1.0))).write_page(tmp_path / "a.html")
    assert "box" in (tmp_path / "a.html").read_text(encoding="utf-8")

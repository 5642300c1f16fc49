"""results.json and the page, read back with the standard library's parsers."""

import base64
import io
import json
import math
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

from comparisons.report import write_report, write_results
from comparisons.report.page import shown
from comparisons.results import Case, Images, Metrics, Tier

NASTY = "<script>alert('x')</script>&\"glass\""
PROVENANCE = {"date": "2025-11-20", "mitsuba": "3.9.1 llvm_ad_rgb", "versions": {"numpy": "2.4"}}


def case(verdict, scene=None, images=None, **numbers):
    metrics = Metrics(math.nan, math.inf, 0.5, 0.25, (0.0, math.inf, -0.01), 0)
    tier = Tier("geometry", verdict, f"why {verdict}", numbers)
    seconds = {"ours": {"load": 0.5, "render": 1.5}, "mitsuba": {"render": 2.0}}
    name = scene or f"scene-{verdict}"
    return Case(name, verdict, f"geometry: {verdict}", (tier,), metrics, seconds, images, ("note",))


class Page(HTMLParser):
    """What a page asks the network for, its headings of cases, and its pictures."""

    VOID = frozenset({"meta", "img", "input", "link", "br"})

    def __init__(self, text):
        super().__init__()
        self.references, self.open, self.titles, self.tags = [], [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.references += [v for k, v in attrs if k in {"src", "href", "srcset", "data", "action"}]
        if tag not in self.VOID:
            self.open.append(tag)
        if tag == "h2":
            self.titles.append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "h2" in self.open:
            self.titles[-1] += data

    def pixels(self, index):
        url = [r for r in self.references if r.startswith("data:")][index]
        data = base64.b64decode(url.removeprefix("data:image/png;base64,"))
        return np.asarray(Image.open(io.BytesIO(data)))


@pytest.fixture
def page(tmp_path):
    def write(*cases):
        path = tmp_path / "report.html"
        write_report(path, cases, PROVENANCE)
        text = path.read_text(encoding="utf-8")
        return Page(text), text

    return write


def test_the_page_asks_for_nothing_outside(page):
    images = Images(np.ones((4, 4, 3)), np.ones((4, 4, 3)))
    parsed, text = page(case("agree", images=images), case("differ"))
    assert parsed.open == []
    assert parsed.references
    assert all(r.startswith(("data:image/png;base64,", "#")) for r in parsed.references)
    assert not re.search(r"https?:|url\(|@import", text)
    assert "default-src 'none'" in text
    assert not {"script", "link", "iframe"} & set(parsed.tags)


def test_failures_come_first(page):
    given = ["agree", "reference-limited", "inconclusive", "not-comparable", "differ", "invalid"]
    parsed, text = page(*map(case, given))
    expected = ["invalid", "differ", "inconclusive", "not-comparable", "reference-limited", "agree"]
    assert [title.split()[0] for title in parsed.titles] == [f"scene-{v}" for v in expected]
    # The verdict is a word beside the name, not only a colour.
    assert [title.split()[-1] for title in parsed.titles] == expected
    assert "6 cases" in text


def test_what_others_wrote_is_escaped(page):
    parsed, text = page(case("differ", scene=NASTY, **{NASTY: NASTY}))
    assert "script" not in parsed.tags
    assert NASTY not in text
    assert parsed.titles[0].startswith(NASTY)


def test_the_difference_is_signed_and_bad_pixels_are_magenta(page):
    ours, mitsuba = np.full((4, 4, 3), 0.5), np.full((4, 4, 3), 0.5)
    ours[0, 0, 1] += 0.1
    ours[0, 1, 2] -= 0.1
    ours[3, 3, 0] = np.nan
    mitsuba[3, 2, 0] = np.inf
    parsed, text = page(case("invalid", images=Images(ours, mitsuba)))
    difference = parsed.pixels(2)
    assert tuple(difference[0, 0]) == (178, 24, 43)
    assert tuple(difference[0, 1]) == (33, 102, 172)
    assert tuple(difference[2, 2]) == (255, 255, 255)
    magenta = [np.argwhere((parsed.pixels(i) == (255, 0, 255)).all(-1)).tolist() for i in range(3)]
    assert magenta == [[[3, 3]], [[3, 2]], [[3, 2], [3, 3]]]
    assert "2 pixels not finite (magenta)" in text
    assert "+0.1</span>" in text


def test_equal_pictures_and_pictures_of_unlike_size(page):
    picture = np.random.default_rng(0).uniform(size=(3, 5, 3))
    parsed, text = page(case("agree", images=Images(picture, picture)))
    assert "equal everywhere" in text
    assert (parsed.pixels(2) == 255).all()
    assert (parsed.pixels(0) == parsed.pixels(1)).all()
    _, text = page(case("invalid", images=Images(picture, picture[1:])))
    assert "unlike size" in text


def test_a_run_without_cases_still_has_a_page(page):
    assert "0 cases" in page()[1]


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


# results.json


def refuse(token):
    raise AssertionError(f"{token} is not JSON")


def test_results_are_strict_json(tmp_path):
    path = tmp_path / "new" / "results.json"
    numbers = {"rays": np.int64(7), "errors": np.array([1.0, np.nan]), "pair": (1, math.inf)}
    write_results(path, [case("differ", **numbers)], PROVENANCE)
    document = json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)
    assert document["schema"] == 1
    assert document["provenance"] == PROVENANCE
    (entry,) = document["cases"]
    assert entry == {
        "scene": "scene-differ",
        "verdict": "differ",
        "reason": "geometry: differ",
        "tiers": {
            "geometry": {
                "status": "differ",
                "reason": "why differ",
                "rays": 7,
                "errors": [1.0, None],
                "pair": [1, None],
            }
        },
        "metrics": {
            "ssim": None,
            "psnr": None,
            "rmse": 0.5,
            "relmse": 0.25,
            "mean_bias": [0.0, None, -0.01],
            "nonfinite": 0,
        },
        "seconds": {"ours": {"load": 0.5, "render": 1.5}, "mitsuba": {"render": 2.0}},
        "notes": ["note"],
    }


def test_a_failed_write_leaves_the_former_file(tmp_path):
    path = tmp_path / "results.json"
    write_results(path, [case("agree")], PROVENANCE)
    before = path.read_bytes()
    with pytest.raises(TypeError):
        write_results(path, [case("agree", odd=object())], PROVENANCE)
    with pytest.raises(UnicodeEncodeError):
        write_results(path, [case("agree", odd="\ud800")], PROVENANCE)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_number_cannot_replace_the_status(tmp_path):
    with pytest.raises(ValueError, match="status"):
        write_results(tmp_path / "r.json", [case("differ", status="agree")], {})
    twice = Tier("geometry", "differ", ""), Tier("geometry", "agree", "")
    with pytest.raises(ValueError, match="same name"):
        write_results(tmp_path / "r.json", [Case("s", "differ", "", twice, None, {})], {})

"""Histograms of differences and maps of FLIP: what they show is what the pictures have."""

import base64
import io
import math
import re

import numpy as np
import pytest
from PIL import Image

from comparisons.report.plots import BINS, FOOT, HEIGHT, WIDTH, histograms
from comparisons.report.thumbnails import LONGEST_MAP, VIRIDIS, flip_map
from comparisons.report.values import rows_of
from comparisons.results.case import Images
from comparisons.statistics.metrics import has_flip, image_metrics

NEEDS_FLIP = pytest.mark.skipif(not has_flip(), reason="flip-evaluator has no wheel here")


def grey(value, size=(4, 6)):
    return np.full((*size, 3), value)


def bars(svg):
    """Heights of the bars from 0 to 1, by their number from the left."""
    path = re.search(r'class="bars" d="([^"]*)"', svg)[1]
    found = re.findall(r"M([\d.]+) \d+v-([\d.]+)h", path)
    return {
        round(float(x) * BINS / WIDTH): float(height) / (HEIGHT - FOOT - 4) for x, height in found
    }


def test_the_difference_on_a_logarithmic_axis_of_counts():
    candidate = grey(1.0, (10, 10))
    candidate[0, 0] += 0.49, -0.49, 0.01
    (one,) = histograms(Images(candidate, grey(1.0, (10, 10))), span=0.5)
    found = bars(one.svg)
    # 298 of 300 values are near 0 (a value at the edge of two bins belongs to the upper one).
    assert found.keys() == {0, BINS // 2, BINS - 1}
    assert found[BINS // 2] == pytest.approx(1.0, abs=0.01)
    for end in (0, BINS - 1):
        assert found[end] == pytest.approx(math.log(2.0) / math.log(299.0), abs=0.01)
    assert one.text == "0.667 % of the values are brighter, 0.333 % darker"
    assert "−0.5" in one.svg
    assert "+0.5" in one.svg


def test_noise_alone_follows_the_line():
    """Of 3e5 normal numbers: each bar within five standard errors of what the line says."""
    rng = np.random.default_rng(5)
    error = rng.uniform(0.5, 2.0, (316, 316, 3))
    reference = rng.uniform(0.0, 3.0, error.shape)
    candidate = reference + rng.normal(0.0, 1.0, error.shape) * error
    _, one = histograms(Images(candidate, reference, error), span=1.0)
    line = re.search(r'class="noise" points="([^"]*)"', one.svg)[1].split()
    expected = [(HEIGHT - FOOT - float(p.split(",")[1])) / (HEIGHT - FOOT - 4) for p in line]
    found = bars(one.svg)
    top = error.size * 0.0993  # the share of the highest bar: of a quarter about 0
    for k, height in enumerate(expected):
        noise = 5.0 * math.sqrt(max(height, 1e-3) / top)
        assert abs(found.get(k, 0.0) - height) <= noise + 0.001  # a tenth of a unit of the drawing
    assert float(one.text.split()[0]) == pytest.approx(0.27, abs=0.06)


@pytest.mark.parametrize(
    ("images", "count"),
    [
        (Images(grey(1.0), grey(1.0, (2, 2))), 0),
        (Images(np.zeros((0, 0, 3)), np.zeros((0, 0, 3))), 0),
        (Images(grey(math.nan), grey(1.0), grey(1.0)), 0),
        (Images(grey(1.0), grey(0.5), grey(0.0)), 1),
        (Images(grey(1e300), grey(-1e300), grey(5e-324)), 1),
        (Images(grey(math.inf), grey(0.5), grey(math.inf)), 0),
    ],
    ids=["sizes", "empty", "NaN", "no noise", "extreme", "infinite"],
)
def test_odd_pictures(images, count):
    assert len(histograms(images, span=0.5)) == count


def test_what_float32_makes_is_no_noise():
    rounded = grey(1.0 + 2.0**-23)
    (only,) = histograms(Images(rounded, grey(1.0), grey(2.0**-28)), 1e-6)
    assert "radiance" in only.title


def test_without_a_difference_there_is_no_axis():
    assert histograms(Images(grey(1.0), grey(1.0)), span=0.0) == []


def pixels(thumbnail):
    data = base64.b64decode(thumbnail.url.partition(",")[2])
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))


@NEEDS_FLIP
def test_the_map_is_that_of_the_metric():
    rng = np.random.default_rng(1)
    reference = rng.uniform(size=(20, 30, 3))
    candidate = reference.copy()
    candidate[5:9, 10:16] *= 2.0
    found, end = flip_map(Images(candidate, reference))
    assert (found.width, found.height) == (30, 20)
    picture = pixels(found)
    assert picture.shape == (20, 30, 3)
    # Turned back into numbers by the nearest colour of the scale, its mean is the metric.
    at = np.linspace(0.0, 16.0, 256)
    scale = np.column_stack([np.interp(at, range(17), channel) for channel in VIRIDIS.T])
    distance = np.abs(picture[:, :, None, :].astype(float) - scale).sum(axis=-1)
    values = distance.argmin(axis=-1) / 255.0 * end
    metric = image_metrics(Images(candidate, reference)).flip
    assert values.mean() == pytest.approx(metric, abs=end / 255.0)
    assert values[6, 13] > 5.0 * values[0, 0]


@NEEDS_FLIP
def test_a_large_map_is_reduced():
    rng = np.random.default_rng(2)
    found, _ = flip_map(Images(*rng.uniform(size=(2, 40, 300, 3))))
    assert (found.width, found.height) == (300, 40)
    assert max(pixels(found).shape) <= LONGEST_MAP


@pytest.mark.parametrize(
    "images",
    [
        Images(grey(1.0), grey(1.0, (2, 2))),
        Images(grey(math.nan), grey(1.0)),
        Images(grey(1.0), grey(math.inf)),
        Images(np.zeros((0, 0, 3)), np.zeros((0, 0, 3))),
    ],
)
def test_no_map_where_flip_is_undefined(images):
    assert flip_map(images) is None


@NEEDS_FLIP
@pytest.mark.parametrize("value", [0.0, 1.0, -1.0, 1e300, 5e-324])
def test_equal_pictures_have_a_dark_map(value):
    found, end = flip_map(Images(grey(value), grey(value)))
    assert end == 0.0
    assert (pixels(found) == VIRIDIS[0]).all()


def test_numbers_as_rows():
    numbers = {
        "rays": 1234,
        "relative_bias": {"R": 0.01, "G": 0.0, "B": -0.02},
        "tiles": {"differ": 3, "worst": {"x": 1, "deeper": {"y": {"z": 2}}}},
        "none": {},
    }
    assert rows_of(numbers) == [
        (0, "rays", ["1,234"]),
        (0, "relative bias", ["1 %", "0 %", "−2 %"]),
        (0, "tiles", []),
        (1, "differ", ["3"]),
        (1, "worst", []),
        (2, "x", ["1"]),
        (2, "deeper", ["y z 2"]),
        (0, "none", [""]),
    ]

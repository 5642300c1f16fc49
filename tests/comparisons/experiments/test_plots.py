"""Plots: the same text each time, text that stays text, nothing from elsewhere, ids of its own."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from skimage import color

from comparisons import report
from comparisons.report.plots import PALETTE, Curve, log_log, save
from comparisons.report.values import power_of_ten, typeset

X = 2.0 ** np.arange(2, 8)


def curve(name: str = "ours", **more) -> Curve:
    return Curve(name, X, 1.0 / X, 0.9 / X, 1.1 / X, **more)


def test_the_same_plot_is_the_same_text():
    assert log_log([curve()], "s", "MSE") == log_log([curve()], "s", "MSE")


def test_is_one_element_that_names_nothing_outside():
    text = log_log([curve("<ours> & more")], "time, s", "relMSE", "A <title>")
    root = ET.fromstring(text)
    assert root.tag.endswith("svg")
    assert "A &lt;title&gt;" in text
    assert "&lt;ours&gt; &amp; more" in text
    assert "time, s" in "".join(root.itertext())
    assert not re.search(r'(?:href|src)="(?!#)', text)
    assert "<style" not in text  # which would reach the whole page
    assert "currentColor" in text


def test_a_file_names_the_command_the_machine_and_the_date(tmp_path, monkeypatch):
    """Below the plot: the picture is higher by as many lines."""
    monkeypatch.setattr("sys.argv", ["x", "stability", "--series", "a, b & c", "--at", "1" * 60])
    facts = {"machine": "a <machine>", "cores": 2, "date": "2026-11-26T02:02:02"}
    plot = log_log([curve()], "s", "MSE")
    save(tmp_path, {"F1-a, b": plot}, facts)
    (file,) = tmp_path.iterdir()
    root = ET.parse(file).getroot()
    assert file.name == "F1-a-b.svg"
    texts = [each.text for each in root.findall("{*}text")]
    words = "reference-rt stability --series 'a, b & c' --at " + "1" * 60
    assert " ".join(texts) == words + "; a <machine>, 2 cores, 2026-11-26"
    heights = [float(each.get("viewBox").split()[3]) for each in (root, ET.fromstring(plot))]
    assert heights[0] == heights[1] + 12 * len(texts)
    assert "background: white" in root.get("style")


def test_ids_are_unique_among_plots():
    plots = [log_log([curve(name)], "s", "MSE") for name in ("a", "b")]
    ids = re.findall(r'\bid="([^"]*)"', "".join(plots))
    assert len(ids) == len(set(ids)) > 0
    for plot in plots:
        own = set(re.findall(r'\bid="([^"]*)"', plot))
        named = re.findall(r'(?:href="#|url\(#)([^")]*)', plot)
        assert set(named) <= own


def test_what_has_no_logarithm_is_left_out():
    """Errors below the reference's noise may be negative, a band's lower end too."""
    y = np.array([0.5, 0.25, -0.1, 0.1, np.nan, np.inf])
    text = log_log([Curve("ours", X, y, y - 0.3, y + 0.3)], "s", "MSE")
    assert "nan" not in text.lower()
    assert "inf" not in text.lower()
    assert log_log([Curve("none", [], [])], "s", "MSE")


def test_levels_within_reach_are_marked():
    text = log_log([curve()], "s", "MSE", levels={"near": 0.1, "far": 1e-9})
    found = "".join(ET.fromstring(text).itertext())
    assert "near" in found
    assert "far" not in found


SIGHT = {
    "normal": np.eye(3),
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanopia": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
"""What linear sRGB looks like: Machado, Oliveira and Fernandes 2009, severity 1."""


def linear(colours):
    """Hexadecimal sRGB as linear RGB (n, 3)."""
    values = np.array([[int(c[k : k + 2], 16) for k in (1, 3, 5)] for c in colours]) / 255.0
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize("sight", SIGHT)
def test_colours_are_distinct_for_everybody(sight):
    """CIEDE2000 of 10, where 1 is just noticed side by side."""
    seen = np.clip(linear(PALETTE) @ np.array(SIGHT[sight]).T, 0.0, 1.0)
    encoded = np.where(seen <= 0.0031308, 12.92 * seen, 1.055 * seen ** (1 / 2.4) - 0.055)
    lab = color.rgb2lab(encoded[None])[0]
    apart = color.deltaE_ciede2000(lab[:, None], lab[None])
    assert apart[np.triu_indices(len(PALETTE), 1)].min() >= 10.0


def test_colours_are_visible_on_both_pages():
    """The contrast of WCAG 1.4.11 for graphics: 3."""
    css = (Path(report.__file__).parent / "page.css").read_text(encoding="utf-8")
    (both,) = re.findall(r"--paper: light-dark\((.*?)\);", css)
    papers = [colour.ljust(7, colour[-1]) for colour in both.split(", ")]  # #fff is #ffffff
    assert len(set(papers)) == 2
    weights = [0.2126, 0.7152, 0.0722]
    curves, pages = linear(PALETTE) @ weights + 0.05, linear(papers) @ weights + 0.05
    contrast = np.maximum(curves[:, None] / pages, pages / curves[:, None])
    assert contrast.min() >= 3.0


def test_formulas_in_print():
    shown = typeset("|t - exact| <= 2^-40 at 1e7, 1.5e-12 s; x^0.6, 2^k, f(a, b) -b, 12e, 1e+06")
    assert shown == "|t − exact| ≤ 2⁻⁴⁰ at 10⁷, 1.5 × 10⁻¹² s; x^0.6, 2^k, f(a, b) -b, 12e, 10⁶"


def test_ticks():
    ticks = [power_of_ten(x) for x in (0.001, 0.5, 1.0, 2000.0, 1e4, 1e-5, 2e-4, 5e6)]
    assert ticks == ["0.001", "0.5", "1", "2000", "10⁴", "10⁻⁵", "2 × 10⁻⁴", "5 × 10⁶"]


def test_there_is_room_for_levels_near_the_curves():
    """Within a factor of ten; others would flatten the curves."""
    levels = {"a limit": 12.0, "a floor": 0.2, "far away": 1e4}
    drawn = log_log([Curve("ours", [1.0, 10.0], [1.0, 2.0])], "x", "y", levels=levels)
    assert [name in drawn for name in levels] == [True, True, False]

"""Plots: the same text each time, text that stays text, nothing from elsewhere, ids of its own."""

import re
import xml.etree.ElementTree as ET

import numpy as np

from comparisons.report.plots import Curve, log_log, save
from comparisons.report.values import power_of_ten

X = 2.0 ** np.arange(2, 8)


def curve(name: str = "ours", **more) -> Curve:
    return Curve(name, X, 1.0 / X, 0.9 / X, 1.1 / X, **more)


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


def test_ticks():
    ticks = [power_of_ten(x) for x in (0.001, 0.5, 1.0, 2000.0, 1e4, 1e-5, 2e-4, 5e6)]
    assert ticks == ["0.001", "0.5", "1", "2000", "10⁴", "10⁻⁵", "2 × 10⁻⁴", "5 × 10⁶"]


def test_there_is_room_for_levels_near_the_curves():
    """Within a factor of ten; others would flatten the curves."""
    levels = {"a limit": 12.0, "a floor": 0.2, "far away": 1e4}
    drawn = log_log([Curve("ours", [1.0, 10.0], [1.0, 2.0])], "x", "y", levels=levels)
    assert [name in drawn for name in levels] == [True, True, False]

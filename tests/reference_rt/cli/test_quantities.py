"""Durations, amounts of memory and shares of the command line."""

import pytest

from reference_rt.cli.quantities import bytes_of, duration, percentage, seconds_of, share_of
from reference_rt.util.errors import UsageError


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("90s", 90), ("10m", 600), ("1.5h", 5400), (" 2 d ", 172800), (".5S", 0.5), ("90", 90)],
)
def test_durations(text, seconds):
    assert seconds_of(text, "--x") == seconds


@pytest.mark.parametrize(
    ("text", "number"),
    [("500M", 500 << 20), ("2G", 2 << 30), ("1.5 GiB", 3 << 29), ("1kb", 1024), ("1T", 1 << 40)],
)
def test_bytes(text, number):
    assert bytes_of(text, "--x") == number


@pytest.mark.parametrize(("text", "share"), [("1%", 0.01), ("0.5 %", 0.005), ("0.25", 0.25)])
def test_shares(text, share):
    assert share_of(text, "--x") == share


@pytest.mark.parametrize("parse", [seconds_of, bytes_of, share_of])
@pytest.mark.parametrize(
    "text", ["", "x", "-1s", "1e3s", "nan", "1.2.3", "١s", "9" * 40, "0", "5x"]
)
def test_what_is_refused(parse, text):
    with pytest.raises(UsageError, match="--x: expected"):
        parse(text, "--x")


def test_words():
    assert duration(4.21) == "4.2 s"
    assert duration(187.2) == "3:07"
    assert duration(7387) == "2:03:07"
    assert percentage(0.0312) == "3.1 %"

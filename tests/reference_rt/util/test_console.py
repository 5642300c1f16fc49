"""Progress on a terminal and elsewhere."""

import io

import pytest
from rich.console import Console

from reference_rt.util import console
from reference_rt.util.console import Bar, ProgressLine


@pytest.fixture
def shown(monkeypatch):
    """shown(is_terminal) -> a `ProgressLine`, and the text that it has written."""

    def make(is_terminal):
        written = io.StringIO()
        monkeypatch.setattr(
            console,
            "Console",
            lambda **_: Console(file=written, force_terminal=is_terminal, width=100),
        )
        return ProgressLine(), written

    return make


def test_compiling_is_counted_on_a_terminal(shown):
    progress, written = shown(True)
    with progress:
        for done in (0, 3, 21):
            progress.compiling(done, 21)
            progress._bar.refresh()
        progress("compile", 1.0)  # said again, as by `render`
        progress("render", 0.0)
        progress("render", 0.5)
        progress._bar.refresh()
    text = written.getvalue()
    assert text.index("compiling kernels: 0 of 21") < text.index("compiling kernels: 3 of 21")
    assert "21 of 21" not in text  # it is over then
    compiled, _, rendered = text.partition("rendering")
    assert "compiling" in compiled
    assert "compiling" not in rendered
    assert "50%" in rendered


def test_a_step_without_anything_to_do_is_not_shown(shown):
    """Kernels that are all in the cache, for example."""
    progress, written = shown(True)
    with progress:
        progress("compile", 1.0)
        progress._bar.refresh()
    assert "compiling" not in written.getvalue()


def test_elsewhere_each_step_is_a_line(shown, monkeypatch):
    progress, written = shown(False)
    now = iter((0.0, 2.0, 10.0, 10.1))
    monkeypatch.setattr(console.time, "perf_counter", lambda: next(now))
    with progress:
        progress.compiling(0, 2)
        progress.compiling(1, 2)
        progress.compiling(2, 2)
        progress("compile", 1.0)
        progress("render", 0.0)
        progress("render", 1.0)  # too short to be mentioned
    assert written.getvalue() == "compiling kernels: 2.0 s\n"


def test_room_for_a_picture_is_small():
    """It is sent four times a second."""
    for width, height in ((40, 20), (300, 100)):
        console = Console(file=io.StringIO(), force_terminal=True, width=width, height=height)
        columns, rows = Bar(console=console).room
        assert 0 < columns <= min(width, 64)
        assert 0 < rows <= min(height // 2, 20)

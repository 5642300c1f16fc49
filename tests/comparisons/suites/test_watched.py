"""What a terminal shows of a comparison as it goes on: lines, and both pictures as they grow."""

import io
from types import SimpleNamespace

import numpy as np
import pytest
from builders import SCENES
from rich.console import Console

from comparisons.compare import watched
from comparisons.compare.budget import Budget
from comparisons.compare.pictures import Replicates
from comparisons.compare.watched import Watched
from comparisons.report.terminal_pictures import pictures_in, so_far
from comparisons.runs.processes import Shown
from comparisons.suites import worker
from comparisons.suites.run import Display
from comparisons.suites.worker import Request, _telling
from comparisons.translator import load
from reference_rt.cameras.film import Film
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Sobol

GREY = np.full((4, 6, 3), 0.25)


def display(monkeypatch, *, steps, is_terminal=True):
    """A display, and what it writes."""
    written = io.StringIO()
    console = Console(file=written, force_terminal=is_terminal, width=90, height=40)
    monkeypatch.setattr("reference_rt.util.console.Console", lambda **_: console)
    return Display(1, steps), written


def request(tmp_path, *, is_watched=False):
    return Request(
        name="some",
        scene=tmp_path / "x.yaml",
        budget=Budget(),
        folder=tmp_path,
        is_watched=is_watched,
    )


def test_pictures_stand_above_the_bar_and_lines_remain(monkeypatch, tmp_path):
    shown, written = display(monkeypatch, steps=True)
    with shown:
        shown.doing(request(tmp_path), "geometry: agree")
        shown.doing(request(tmp_path), Shown(so_far(None, GREY)))
        shown._bar.refresh()
    text = written.getvalue()
    assert "some: geometry: agree" in text
    assert text.count("▀") >= 6
    assert "base64" not in text  # neither a line nor a step of the bar


def test_ours_may_be_still_to_come():
    (first,), both = pictures_in(so_far(None, GREY)), pictures_in(so_far(0.25 * GREY, GREY))
    assert first[0] == "Mitsuba's"
    assert [title for title, _ in both] == ["ours", "Mitsuba's"]
    # Both by one white level: ours is darker.
    (_, ours), (_, theirs) = both
    assert ours.shape == theirs.shape == GREY.shape
    assert (ours < theirs).all()
    assert (theirs == first[1]).all()


def test_pictures_are_shown_now_and_then(monkeypatch):
    now, shown, said = [0.0], [], []
    monkeypatch.setattr(watched, "time", SimpleNamespace(monotonic=lambda: now[0]))
    say = Watched(said.append, shown.append)
    for now[0] in (1.0, 1.1, 1.4, 1.6):
        say.pictures([], [GREY])
    say("geometry: agree")
    assert len(shown) == 2
    assert said == ["geometry: agree"]


@pytest.mark.parametrize("is_watched", [False, True])
def test_only_who_watches_is_sent_pictures(monkeypatch, tmp_path, is_watched):
    sent = []
    monkeypatch.setattr(worker, "send", lambda answers, **message: sent.append(message))
    say = _telling(request(tmp_path, is_watched=is_watched), io.StringIO())
    say("begins")
    scene = Scene.load(SCENES / "cornell_box.yaml").changed(
        film=Film(width=8, height=6), sampler=Sobol(spp=2)
    )
    both = Replicates(scene, scene.tables, load(scene), Budget(), 1, 8, say)
    both.grow(2)
    assert sent[0] == {"say": "begins"}
    # Mitsuba's are there first; ours follow, if half a second has passed.
    assert [*sent[1:2]] == ([{"show": sent[1]["show"]}] if is_watched else [])
    assert is_watched or len(sent) == 1
    assert both.count == 2

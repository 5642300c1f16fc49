"""Pictures above a bar on a terminal that answers, and one that does not: what arrives is what was
sent, in place of the picture before, and the terminal is in order afterwards."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from fake_terminal import CELL, FakeTerminal

from reference_rt.cli import terminal_answer
from reference_rt.util.errors import UsageError

DRAWS = {
    "kitty": {"kitty": True, "sixel": True},
    "sixel": {"sixel": True},
    "blocks": {},
}

TIMES = 13
"""Pictures are made as many times as large: 20 rows of pixels in 12 of cells, 264 pixels."""

PROGRAM = """
import os, sys, time
import numpy as np
from reference_rt.cli.pictured import PicturedLine
def picture(seed, rows=20, columns=30):
    rng = np.random.default_rng(seed)
    palette = rng.integers(0, 256, (16, 3), dtype=np.uint8)
    return palette[rng.integers(0, 16, (rows, columns))]
with PicturedLine() as bar:
    bar("render", 0.5)
"""


def picture(seed, rows=20, columns=30):
    """The pixels of the program's picture."""
    rng = np.random.default_rng(seed)
    palette = rng.integers(0, 256, (16, 3), dtype=np.uint8)
    return palette[rng.integers(0, 16, (rows, columns))].astype(int)


def larger(pixels, times):
    return np.kron(pixels, np.ones((times, times, 1), int))


@pytest.fixture
def terminal():
    """terminal(...) -> a `FakeTerminal`."""
    made = []

    def make(**what):
        made.append(FakeTerminal(**what))
        return made[-1]

    yield make
    for one in made:
        one.close()


def shown(bar_does, terminal, **environment):
    """Run lines of a program beneath a bar; it ends as it stands."""
    lines = [*bar_does, "bar._bar.refresh()", "os._exit(0)"]
    program = PROGRAM + "".join(f"    {line}\n" for line in lines)
    assert terminal.run(program, **environment) == 0
    return terminal


@pytest.mark.parametrize("protocol", DRAWS)
def test_the_picture_arrives_and_the_bar_is_below(terminal, protocol):
    """Exactly; sixels have colours of whole percent, blocks two pixels in a cell."""
    seen = shown(['bar.show_pictures([("", picture(1))])'], terminal(**DRAWS[protocol]))
    found = seen.picture()
    if protocol == "blocks":
        # 30 x 20 pixels in 30 x 10 cells.
        found = found[:: CELL[1] // 2, :: CELL[0]]
        assert (found == picture(1)).all()
    else:
        expected = larger(picture(1), TIMES)
        assert found.shape == expected.shape
        assert np.abs(found - expected).max() <= {"kitty": 0, "sixel": 2}[protocol]
    assert set(seen.drawn) == {protocol} - {"blocks"}
    words = [line for line in seen.lines() if line.strip(" ▀")]
    assert len(words) == 1
    assert words[0].startswith("rendering")
    rows = -(-20 * TIMES // CELL[1]) if protocol != "blocks" else 10
    assert seen.lines().index(words[0]) == rows


@pytest.mark.parametrize("protocol", ["kitty", "sixel"])
@pytest.mark.parametrize("at_the_end", [False, True])
def test_a_new_picture_takes_the_place_of_the_old(terminal, protocol, at_the_end):
    """Also where the screen has scrolled; refreshes of the bar in between send nothing."""
    before = ["print(*range(40), sep=chr(10))"] if at_the_end else []
    does = [*before, 'bar.show_pictures([("", picture(1))])']
    does += ["bar._bar.refresh()"] * 5
    does += ['bar.show_pictures([("", picture(2))])', *["bar._bar.refresh()"] * 5]
    seen = shown(does, terminal(**DRAWS[protocol]))
    assert np.abs(seen.picture() - larger(picture(2), TIMES)).max() <= 2
    assert seen.drawn == [protocol, protocol]
    assert len(seen.placed) == (protocol == "kitty")
    assert sum(line.startswith("rendering") for line in seen.lines()) == 1


@pytest.mark.parametrize("protocol", ["kitty", "sixel"])
@pytest.mark.parametrize("counts", [(1, 2), (2, 1)], ids=str)
def test_pictures_of_other_sizes_take_the_place_of_the_old(terminal, protocol, counts):
    """As in a comparison, where Mitsuba's is there first."""
    does = []
    for count in counts:
        listed = ", ".join(f'("", picture({k}))' for k in range(count))
        does += [f"bar.show_pictures([{listed}])", "bar._bar.refresh()"]
    seen = shown(does, terminal(**DRAWS[protocol]))
    found = seen.picture()
    last = larger(picture(0), TIMES if counts[-1] == 1 else 9)
    height, width = last.shape[:2]
    assert found.shape[0] == height
    assert np.abs(found[:, :width] - last).max() <= 2
    assert (found.shape[1] == width) == (counts[-1] == 1)
    assert len(seen.placed) == counts[-1] * (protocol == "kitty")
    assert sum(line.startswith("rendering") for line in seen.lines()) == 1


@pytest.mark.parametrize("protocol", ["kitty", "sixel"])
def test_lines_go_above_the_picture(terminal, protocol):
    does = ['bar.show_pictures([("ours", picture(1)), ("theirs", picture(2))])']
    does += ["bar._bar.refresh()", 'bar.line("a line")', "bar._bar.refresh()"]
    seen = shown(does, terminal(**DRAWS[protocol]))
    assert seen.lines()[:2] == ["a line", "ours" + " " * 23 + "  theirs"]  # of 28 cells each
    both = seen.picture()
    one, two = larger(picture(1), 9), larger(picture(2), 9)
    width = one.shape[1]
    assert np.abs(both[:, :width] - one).max() <= 2
    assert np.abs(both[:, -width:] - two).max() <= 2
    assert len(seen.placed) == 2 * (protocol == "kitty")


@pytest.mark.parametrize("protocol", DRAWS)
def test_nothing_is_left_at_the_end(terminal, protocol):
    seen = terminal(**DRAWS[protocol])
    line = '    bar.show_pictures([("", picture(1))])\n    bar._bar.refresh()\n'
    assert seen.run(PROGRAM + line) == 0
    assert seen.picture() is None
    assert not any(seen.lines())
    assert not seen.placed
    assert seen.left_in_input() == (b"", True)


@pytest.mark.parametrize("protocol", ["kitty", "sixel"])
def test_what_is_printed_remains(terminal, protocol):
    """As the pictures at the end of a comparison."""
    seen = terminal(**DRAWS[protocol])
    line = '    bar._console.print(bar.row([("ours", picture(1))], 20, 8))\n'
    assert seen.run(PROGRAM + line + 'print("after")\n') == 0
    assert np.abs(seen.picture() - larger(picture(1), 6)).max() <= 2
    assert [line for line in seen.lines() if line] == ["ours", "after"]
    assert seen.lines().index("after") == 1 + -(-20 * 6 // CELL[1])


@pytest.mark.parametrize(
    ("environment", "asked", "drawn"),
    [
        ({}, ["kitty", "attributes"], ["kitty"]),
        ({"TMUX": "/tmp/x,1,0"}, ["attributes"], ["sixel"]),
        ({"TERM": "screen-256color"}, ["attributes"], ["sixel"]),
        ({"STY": "1.pts"}, ["attributes"], ["sixel"]),
        ({"NO_COLOR": "1"}, [], []),
        ({"TERM": "dumb"}, [], []),
        ({"REFERENCE_RT_PICTURES": "sixel"}, [], ["sixel"]),
        ({"REFERENCE_RT_PICTURES": "blocks"}, [], []),
        ({"REFERENCE_RT_PICTURES": "none"}, [], []),
        ({"REFERENCE_RT_PICTURES": "kitty", "NO_COLOR": "1"}, [], ["kitty"]),
    ],
    ids=str,
)
def test_the_environment_has_its_say(terminal, environment, asked, drawn):
    """What is in tmux or screen is not asked for kitty's protocol, which these do not know."""
    does = ['bar.show_pictures([("", picture(1))])']
    seen = shown(does, terminal(kitty=True, sixel=True), **environment)
    assert seen.asked == asked
    assert seen.drawn == drawn
    has_blocks = any("▀" in line for line in seen.lines())
    assert has_blocks == (environment.get("REFERENCE_RT_PICTURES") == "blocks")


def test_an_unknown_protocol_is_refused(monkeypatch):
    monkeypatch.setenv("REFERENCE_RT_PICTURES", "braille")
    with pytest.raises(UsageError, match=r"expected one of kitty, sixel, blocks, none, got 'bra"):
        terminal_answer.chosen()


@pytest.mark.parametrize("redirected", ["0", "2"])
def test_only_a_terminal_is_asked(terminal, redirected):
    """Not where standard input or the output is another file."""
    program = f"""
import os, sys
from reference_rt.cli.terminal_answer import protocol
os.dup2(os.open("/dev/null", os.O_RDWR), {redirected})
os._exit(0 if protocol(sys.stderr) == "blocks" else 1)
"""
    seen = terminal(kitty=True)
    assert seen.run(program) == 0
    assert seen.asked == []


def test_a_process_of_the_background_does_not_ask(terminal):
    """The kernel would stop it for changing the terminal's mode."""
    program = """
import os, sys
from reference_rt.cli.terminal_answer import protocol
child = os.fork()
if not child:
    os.setpgid(0, 0)
    os._exit(0 if protocol(sys.stderr) == "blocks" else 1)
_, status = os.waitpid(child, os.WUNTRACED)
os._exit(status != 0)
"""
    seen = terminal(kitty=True)
    assert seen.run(program) == 0
    assert seen.asked == []


def test_keys_typed_ahead_are_not_lost(terminal):
    seen = terminal(kitty=True)
    seen.type(b"ls -l")
    does = ["import reference_rt.cli.terminal_answer as a", "assert a.protocol(sys.stderr)"]
    shown(does, seen)
    assert seen.asked == []
    assert seen.left_in_input() == (b"ls -l", True)


def test_a_silent_terminal_has_blocks(terminal):
    seen = shown(['bar.show_pictures([("", picture(1))])'], terminal(silent=True, kitty=True))
    assert seen.asked == ["kitty", "attributes"]
    assert (seen.picture()[:: CELL[1] // 2, :: CELL[0]] == picture(1)).all()


def test_no_more_time_is_spent_than_the_limit(terminal, monkeypatch):
    """Nor on one that sends something else for ever."""
    now, waited = [0.0], []

    def waiting(terminal, seconds):
        waited.append(seconds)
        now[0] += 0.07 if seconds else 0.0
        return len(waited) > 1 and seconds > 0.0

    monkeypatch.setattr(terminal_answer, "time", SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(terminal_answer, "_is_waiting", waiting)
    monkeypatch.setattr(terminal_answer, "_is_foreground", lambda terminal: True)
    monkeypatch.setattr(
        terminal_answer.os, "read", lambda terminal, most: b"keys" if len(waited) < 99 else 1 / 0
    )
    seen = terminal()
    assert terminal_answer.said_by(terminal_answer.os.ttyname(seen.slave)) == "blocks"
    assert now[0] <= terminal_answer.PATIENCE + 0.07
    assert all(
        earlier > later for earlier, later in itertools.pairwise(waited[1:])
    )  # each wait is for what is left


@pytest.mark.parametrize("late", [False, True])
def test_ctrl_c_leaves_the_terminal_in_order(terminal, tmp_path, late):
    """Nothing of an answer is left that comes during the interruption, or after it."""
    go_on = tmp_path / "go on"
    program = f"""
import os, sys, time
from reference_rt.cli import terminal_answer
terminal_answer.PATIENCE = 60.0
try:
    terminal_answer.protocol(sys.stderr)
except KeyboardInterrupt:
    print("interrupted", flush=True)
    while not os.path.exists({str(go_on)!r}):
        time.sleep(0.01)
    sys.exit(7)
"""
    seen = terminal(silent=True)
    typed = []

    def interrupt(terminal):
        if "attributes" in terminal.asked and not typed:
            typed.append(b"\x03")
            terminal.type(b"\x03")
        if any("interrupted" in line for line in terminal.lines()) and not go_on.exists():
            if late:
                terminal.type(b"\x1b[?62;4c")
            go_on.touch()

    assert seen.run(program, interrupt) == 7
    assert typed
    assert seen.left_in_input() == (b"", True)


@pytest.mark.parametrize("protocol", DRAWS)
def test_preview_draws_as_the_terminal_can(terminal, protocol):
    """`preview --to terminal`, without a scene."""
    program = (
        PROGRAM.partition("with")[0]
        + """
from reference_rt.cli import preview
preview.pixels_of, preview.words = lambda pixels: pixels, lambda pixels: "words"
view = preview.view_of("terminal", None)
for seed in (1, 2):
    view.show(picture(seed))
"""
    )
    seen = terminal(**DRAWS[protocol])
    assert seen.run(program) == 0
    found = seen.picture()
    found = found[:: CELL[1] // 2, :: CELL[0]] if protocol == "blocks" else found
    assert np.abs(found - picture(2)).max() <= 2
    assert [line for line in seen.lines() if line.strip("▀")] == ["words"]
    assert seen.left_in_input() == (b"", True)

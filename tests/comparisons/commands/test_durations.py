"""Every duration is said in one way: in options of all commands, and in files of suites."""

import gc
import math
import re
from contextlib import suppress

import pytest
from command_line import ARGUMENTS, COMMAND, WorkBegan, invoke

from comparisons.compare.budget import Budget
from comparisons.suites.suite import Suite
from reference_rt.util.errors import SceneError

OPTIONS = {
    (name, option.opts[0]): option
    for name, command in COMMAND.commands.items()
    for option in command.params
    if option.opts[0].startswith("-")
}

MORE = {
    ("gate", "--time-limit"): ["--command", "prog {output}"],
    ("render", "--time-limit"): ["-o", "picture.exr"],
}
"""What a command needs besides, that the option applies."""

OTHERS = {
    ("render", "--checkpoint"),
    ("fuzz", "--count"),
    ("converge", "--targets"),
    ("methods", "--full"),
    ("stability", "--full"),
}
"""Options whose help names a time, and which are none."""

DURATIONS = [at for at, option in OPTIONS.items() if option.metavar == "TIME"]


def test_every_option_that_is_a_duration_is_declared_as_one() -> None:
    """Those whose name or help speaks of time or seconds."""
    words = re.compile(r"\b(seconds?|time|so long|minutes?|hours?|duration)\b", re.I)
    spoken = {
        at
        for at, option in OPTIONS.items()
        if words.search(f"{at[1]} {option.metavar} {option.help}".replace("a time", ""))
    }
    assert spoken - OTHERS == set(DURATIONS)
    assert len(DURATIONS) >= 6


def told(command: str, option: str, value: str) -> str:
    """What the command says before its work begins."""
    needed = [word for word in ARGUMENTS[command] if word != "no.exr"]
    with suppress(WorkBegan):
        more = MORE.get((command, option), [])
        return invoke(command, *needed, *more, option, value, catch_exceptions=False).output
    return ""


@pytest.mark.cases(3)
@pytest.mark.parametrize(("command", "option"), DURATIONS)
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.usefixtures("fake_runners", "idle")
def test_all_take_the_same_and_refuse_the_same(command: str, option: str) -> None:
    for value in ("-1", "nan", "5x", "1e3s", "soon", "", "0s"):
        expected = f"{option}: expected a duration, such as 90s, 10m or 1.5h, got '{value}'"
        assert told(command, option, value) == f"error: {expected}\n"
    for value in ("8s", "10m", "1h", "1.5h", "90", "2 d"):
        assert "duration" not in told(command, option, value)
    gc.collect()


def test_files_of_suites_take_the_same() -> None:
    for text, seconds in (("8s", 8), ("10m", 600), ("90", 90), (90, 90)):
        assert Suite(about="some", case_seconds=text).case_seconds == seconds
        assert Budget(seconds=text).seconds == seconds
    for text in ("-1", "nan", "5x", -1, math.nan):
        with pytest.raises(SceneError, match="case_seconds: "):
            Suite(about="some", case_seconds=text)

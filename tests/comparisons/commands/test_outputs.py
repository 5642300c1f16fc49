"""Every file that a command writes is checked before its work begins: nobody waits for minutes for
results that cannot be stored.

The commands and their options are those of the program itself: a command that is added fails these
tests until its outputs are listed here.
"""

import gc
import inspect
import os
import socket
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import pytest
from command_line import ARGUMENTS, COMMANDS, WorkBegan, invoke
from suite_runs import run_in, scenes

INPUTS = {
    "scene",
    "scenes",
    "candidates",
    "reference",
    "variance",
    "folder",
    "mesh",
    "unused",
    "cluster",
}
"""Parameters that name what is read."""

FILES = {
    ("render", "output"): ["x.exr"],
    ("render", "preview"): ["x.png"],
    ("render", "checkpoint"): ["x"],
    ("derivative", "output"): ["x.exr"],
    ("trace", "out"): [""],
    ("fuzz", "out"): ["fuzz.json", "fuzz.html"],
    ("fuzz", "junit"): [""],
    ("convert", "output"): ["x.yaml"],
    ("compare", "out"): ["results.json", "report.html", "cases/x"],
    ("suite", "out"): ["results.json", "report.html", "cases/x"],
    ("suite", "junit"): [""],
    ("gate", "out"): ["results.json", "report.html"],
    ("gate", "junit"): [""],
    ("gate", "baselines"): [],  # which it reads
    ("accept", "baselines"): ["room/x"],
    ("report", "out"): [""],
    ("selftest", "out"): ["selftest.json", "selftest.md"],
    ("converge", "out"): ["results.json", "results.csv", "report.html", "rungs/x"],
    ("converge", "markdown"): [""],
    ("converge", "plots"): ["x"],
    ("methods", "out"): ["results.json", "results.csv", "methods.html"],
    ("bench", "out"): ["results.json", "bench.md", "rows/x"],
    ("bench", "markdown"): [""],
    ("stability", "out"): [
        "results.json", "results.csv", "stability.html", "settings/x", "pictures/x"
    ],
    ("stability", "markdown"): [""],
    ("stability", "plots"): ["x"],
    ("derivatives", "out"): ["results.json", "report.html", "cases/x"],
    ("derivatives", "markdown"): [""],
    ("variants", "out"): ["results.json", "report.html"],
    ("variants", "markdown"): [""],
    ("versions", "out"): ["results.json", "report.html"],
    ("versions", "markdown"): [""],
    ("truth", "out"): ["results.json", "report.html"],
    ("truth", "markdown"): [""],
}  # fmt: skip
"""What is written below the path that an option names; "": the path itself."""


def _paths(callback: Any) -> set[str]:
    """The parameters of a command that are paths."""
    hints = get_type_hints(callback, include_extras=True)
    found = set()
    for name in inspect.signature(callback).parameters:
        hint = hints[name]
        kind = get_args(hint)[0] if get_origin(hint) is Annotated else hint
        if kind is Path or Path in get_args(kind):
            found.add(name)
    return found


def test_every_option_that_is_a_path_is_an_input_or_a_listed_output():
    assert set(COMMANDS) == set(ARGUMENTS)
    outputs = {(name, option) for name, c in COMMANDS.items() for option in _paths(c) - INPUTS}
    assert outputs == set(FILES)


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(path))


ELSE: dict[str, tuple[Callable[[Path], Any], str]] = {
    "a folder": (Path.mkdir, "is a folder; expected the name of a file"),
    "a pipe": (os.mkfifo, "is a pipe; expected the name of a file"),
    "a link to a pipe": (
        lambda path: [os.mkfifo(path.with_name("pipe")), path.symlink_to("pipe")],
        "is a pipe; expected the name of a file",
    ),
    "a socket": (_socket, "is a socket; expected the name of a file"),
    "a device": (
        lambda path: path.symlink_to("/dev/null"), "is a device; expected the name of a file",
    ),
    "a loop": (lambda path: path.symlink_to(path.name), "Too many levels of symbolic links"),
    "a read-only file": (
        lambda path: [path.write_text("kept"), path.chmod(0o400)],
        "may not be written; expected a file that is not read-only",
    ),
}  # fmt: skip
"""What may stand in a file's place, how it gets there, and what is said."""

WAYS: dict[str, tuple[Callable[[Path], Any], str]] = {
    "a file": (lambda path: path.write_text("a file"), "is a file; expected a folder"),
    "a pipe": (os.mkfifo, "is a pipe; expected a folder"),
    "a device": (lambda path: path.symlink_to("/dev/null"), "is a device; expected a folder"),
    "a dead link": (
        lambda path: path.symlink_to("nowhere"), "is a link to nothing; expected a folder",
    ),
}  # fmt: skip
"""What may stand in the place of a folder on the way, how it gets there, and what is said."""

CASES = [
    (command, option, file, where, what)
    for (command, option), files in FILES.items()
    for file in files
    for where, kinds in (("on the way", WAYS), ("in its place", ELSE), ("nowhere", [""]))
    for what in kinds
    # Into a folder for records any name may be written.
    if (file.rpartition("/")[2], where) != ("x", "in its place")
]


@pytest.mark.cases(14)
@pytest.mark.parametrize(("command", "option", "file", "where", "what"), CASES)
@pytest.mark.usefixtures("fake_runners", "idle")
def test_an_output_that_cannot_be_written_is_refused_before_work_begins(
    command, option, file, where, what, tmp_path, monkeypatch
):
    out = tmp_path / "here"
    named = out / file if option in ("output", "preview") else out
    needed = ["--output", "picture.png"] if command == "render" and option != "output" else []
    target = out / file if file else out
    said = ""
    if where == "nowhere":  # no folder can be made there
        named = Path("/proc/none") / named.relative_to(tmp_path)
    elif where == "on the way":
        make, said = WAYS[what]
        blocker = target.parent if file else (tmp_path / "file")
        named = blocker / "x" if not file else named
        blocker.parent.mkdir(parents=True, exist_ok=True)
        make(blocker)
    else:
        make, said = ELSE[what]
        if what == "a read-only file":  # which there is not for root
            monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK)
        target.parent.mkdir(parents=True, exist_ok=True)
        make(target)
    (tmp_path / "run" / "cases").mkdir(parents=True)  # for `report`
    before = set(tmp_path.rglob("*"))
    words = [command, *ARGUMENTS[command], *needed, f"--{option}", str(named)]
    result = invoke(*words, catch_exceptions=False)
    told = result.stderr.splitlines()
    assert [line for line in told if line.startswith("error: ")] == told, result.output
    assert len(told) == 1
    # A file in which a table is to be put must be there: to name another is wrong usage.
    wrong_usage = ("cannot be read", "has no marker block")
    assert result.exit_code == (2 if any(w in told[0] for w in wrong_usage) else 3), result.output
    assert option == "markdown" or result.exit_code == 3
    assert str(named) in told[0]
    assert option == "markdown" or said.partition(";")[0] in told[0]
    assert set(tmp_path.rglob("*")) == before  # no file, and no folder


@pytest.mark.cases(6)
@pytest.mark.parametrize(
    ("command", "option", "file"),
    [
        (command, option, file)
        for (command, option), files in FILES.items()
        for file in files
        if file.rpartition("/")[2] != "x"
    ],
)
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.usefixtures("fake_runners", "idle")
def test_a_link_stays_when_a_command_clears_its_outputs(command, option, file, tmp_path):
    """What an earlier run wrote is removed before work begins: behind the link."""
    out, elsewhere = tmp_path / "here", tmp_path / "elsewhere"
    elsewhere.mkdir()
    named = out / file if option in ("output", "preview") else out
    link = out / file if file else out
    link.parent.mkdir(parents=True, exist_ok=True)
    link.symlink_to(elsewhere / "file")
    (elsewhere / "file").write_text("<!-- of an earlier run -->")
    needed = ["--output", "picture.png"] if command == "render" and option != "output" else []
    (tmp_path / "run" / "cases").mkdir(parents=True)  # for `report`
    with suppress(WorkBegan):
        invoke(command, *ARGUMENTS[command], *needed, f"--{option}", named, catch_exceptions=False)
    gc.collect()  # of what the command had opened when its work was not let begin
    assert link.readlink() == elsewhere / "file"


@pytest.mark.parametrize("command", ["suite", "gate"])
@pytest.mark.usefixtures("fake_runners", "idle")
def test_so_is_the_summary_of_github(command, tmp_path, monkeypatch):
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path))
    result = invoke(command, *ARGUMENTS[command], catch_exceptions=False)
    assert (result.exit_code, result.stderr) == (
        3, f"error: {tmp_path}: is a folder; expected the name of a file\n",
    )  # fmt: skip


@pytest.mark.usefixtures("idle")
def test_a_baseline_is_not_written_over_a_file(tmp_path):
    (tmp_path / "baselines").mkdir()
    (tmp_path / "baselines" / "room").write_text("mine")
    result = invoke("accept", *ARGUMENTS["accept"])
    assert result.exit_code == 3
    assert "is a file; expected the folder of a baseline" in result.stderr
    assert (tmp_path / "baselines" / "room").read_text() == "mine"


@pytest.mark.slow
@pytest.mark.usefixtures("fake_runners")
def test_the_page_of_a_former_run_does_not_outlive_it(tmp_path):
    """A run that is killed leaves no page that says what an earlier run found."""
    folder, out = scenes(tmp_path / "scenes", "a"), tmp_path / "out"
    run_in(out, folder)
    assert (out / "report.html").exists()
    scenes(folder, "unavailable")
    with pytest.raises(Exception, match="no reference here"):
        run_in(out, folder)
    assert not (out / "report.html").exists()

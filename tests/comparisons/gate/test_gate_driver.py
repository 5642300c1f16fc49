"""Running a renderer: each way to fail has its message, and none leaves a picture behind."""

import os
import select
import shlex
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from comparisons.gate.driver import Command, Driver, RendererError
from reference_rt.util.errors import ImageError, UsageError
from reference_rt.util.files import temporary_folder

RENDERER = """\
import os, signal, subprocess, sys, time
from pathlib import Path
import numpy as np
how, output, seed = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])
picture = np.random.default_rng(seed).random((4, 6, 3))
print("how", how, flush=True)
if len(sys.argv) > 4:  # a child in a session of its own, which holds the output open
    sleep = [sys.executable, "-c", "import time; time.sleep(600)"]
    child = subprocess.Popen(sleep, start_new_session=True)
    Path(sys.argv[4]).write_text(str(child.pid))
if how == "fails":
    print("one\\nthe sky\\x1b[2J is\\n\\nfalling", file=sys.stderr)
    sys.exit(7)
if how == "crashes":
    os.kill(os.getpid(), signal.SIGSEGV)
if how == "hangs":
    time.sleep(600)
if how == "floods":
    while True:
        print("x" * 1000)
if how == "beside":
    np.save(output.with_name("mine.npy"), picture)
if how == "here":
    np.save("mine.npy", picture)
if how == "folder":
    output.mkdir()
if how == "pipe":
    os.mkfifo(output)
if how == "dead":
    output.symlink_to("nowhere")
if how == "device":
    output.symlink_to("/dev/zero")
if how == "empty":
    output.touch()
if how == "rubbish":
    output.write_text("rubbish")
if how == "well":
    with output.open("wb") as file:
        np.save(file, picture)
"""


@pytest.fixture
def renderer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The start of its command line; the working folder is the test's own."""
    script = tmp_path / "my renderer.py"  # a space, which a shell would break
    script.write_text(RENDERER)
    monkeypatch.chdir(tmp_path)
    return f"{shlex.quote(sys.executable)} {shlex.quote(str(script))}"


def command(renderer: str, how: str, seconds: float = 600.0) -> Command:
    return Command(f"{renderer} {how} {{output}} {{seed}}", suffix=".npy", seconds=seconds)


@pytest.mark.parametrize(
    ("how", "what"),
    [
        ("folder", "is a folder"),
        ("pipe", "is a pipe"),
        ("device", "is a device"),
        ("dead", "is a link to nothing"),
    ],
)
def test_what_is_no_file_is_named(renderer: str, tmp_path: Path, how: str, what: str) -> None:
    said = f"^what the renderer wrote with seed 3 {what}; expected a picture's file at the path"
    with pytest.raises(RendererError, match=said):
        Driver(command(renderer, how), tmp_path / "kept").pictures([3])


def test_links_among_the_kept_pictures_stay(renderer: str, tmp_path: Path) -> None:
    """The file that a link names is written; what is no file is refused."""
    keep, elsewhere = tmp_path / "kept", tmp_path / "elsewhere"
    keep.mkdir()
    (keep / "candidate-00.npy").symlink_to(elsewhere)
    for seed in (5, 6):  # without the file, and with it
        Driver(command(renderer, "well"), keep).pictures([seed])
        assert (keep / "candidate-00.npy").readlink() == elsewhere
        expected = np.random.default_rng(seed).random((4, 6, 3))
        np.testing.assert_array_equal(np.load(elsewhere), expected)
    (keep / "candidate-01.npy").symlink_to("/dev/null")
    with pytest.raises(ImageError, match=r"candidate-01.npy: is a device; expected the name of a "):
        Driver(command(renderer, "well"), keep)


def test_each_seed_has_its_picture(renderer: str, tmp_path: Path) -> None:
    keep = tmp_path / "kept"
    keep.mkdir()
    (keep / "candidate-09.npy").write_text("of an earlier run")
    said: list[str] = []
    pictures = Driver(command(renderer, "well"), keep, said.append).pictures(range(5, 8))
    for seed, picture in zip(range(5, 8), pictures, strict=True):
        expected = np.random.default_rng(seed).random((4, 6, 3))
        np.testing.assert_array_equal(picture.radiance, expected)
        assert Path(picture.name).is_file()
    names = [f"candidate-0{k}.npy" for k in range(3)]
    assert sorted(path.name for path in keep.iterdir()) == names
    assert said == [f"candidate {k + 1}, seed {5 + k}" for k in range(3)]


@pytest.mark.cases(4)
@pytest.mark.parametrize(
    ("how", "message"),
    [
        (
            "fails",
            r"failed with seed 1: exit code 7, expected 0; it said: .*"
            r"one \| the sky\?\[2J is \| falling$",
        ),
        ("crashes", "crashed with seed 1: SIGSEGV; it said"),
        (
            "nothing",
            "ended without an error with seed 1, but wrote no file; expected candidate-00.npy",
        ),
        ("beside", "another file with seed 1: mine.npy in the same folder; expected candidate-00"),
        ("here", "another file with seed 1: mine.npy in the working folder; expected candidate"),
    ],
)
def test_failures(renderer: str, tmp_path: Path, how: str, message: str) -> None:
    with pytest.raises(RendererError, match=message) as caught:
        Driver(command(renderer, how), tmp_path / "kept").pictures(range(1, 3))
    assert caught.value.exit_code == 4
    assert "\n" not in str(caught.value)
    assert [path.name for path in tmp_path.glob("kept/*")] == ["renderer.log"]


@pytest.mark.parametrize(
    ("how", "message"), [("empty", "is empty"), ("rubbish", "is not an image")]
)
def test_what_is_written_must_be_a_picture(
    renderer: str, tmp_path: Path, how: str, message: str
) -> None:
    with pytest.raises(ImageError, match=message):
        Driver(command(renderer, how), tmp_path / "kept").pictures(range(1, 2))


@pytest.mark.parametrize("how", ["hangs", "well", "fails"])
def test_no_process_outlives_the_renderer(
    renderer: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    note = tmp_path / "child.pid"

    waited = select.select

    def no_more(*watched: Any) -> tuple[list[Any], ...]:
        """Time is over as soon as there is a child."""
        while not (note.exists() and note.read_text()):
            if (found := waited(*watched[:3], 0.01))[0]:
                return found
        return [], [], []

    if how == "hangs":
        monkeypatch.setattr(select, "select", no_more)
    line = f"{renderer} {how} {{output}} {{seed}} {note}"
    driver = Driver(Command(line, suffix=".npy"), tmp_path / "kept")
    if how == "well":
        assert len(driver.pictures(range(3, 4))) == 1
    else:
        message = "limit of 600 s with seed 3, and was killed" if how == "hangs" else "exit code 7"
        with pytest.raises(RendererError, match=message):
            driver.pictures(range(3, 4))
    assert not _runs(int(note.read_text()))


def test_what_a_renderer_prints_is_bounded(renderer: str, tmp_path: Path) -> None:
    with pytest.raises(RendererError, match=r"it said: .*\| x+ \|"):
        Driver(command(renderer, "floods", 2.0), tmp_path / "kept").pictures(range(1, 2))
    text = (tmp_path / "kept" / "renderer.log").read_bytes()
    assert text.startswith(b"how floods\nxxx")
    assert b" bytes are left out]\n" in text
    assert 9_900_000 < len(text) < 10_100_000


def test_a_gate_that_is_killed(renderer: str, tmp_path: Path) -> None:
    """Its renderer ends, and what it left is removed by the next one."""
    temporary, note = tmp_path / "temporary", tmp_path / "child.pid"
    temporary.mkdir()
    (temporary / ".reference_rt-of-a-user").mkdir()  # no folder of ours: it has no lock
    code = (
        "import sys; from pathlib import Path; from comparisons.gate.driver import Command, Driver;"
        "Driver(Command(sys.argv[1]), Path(sys.argv[2])).pictures(range(1, 2))"
    )
    template = f"{renderer} hangs {{output}} {{seed}} {note}"
    gate = subprocess.Popen(
        [sys.executable, "-c", code, template, str(tmp_path / "kept")],
        env={**os.environ, "TMPDIR": str(temporary)},
    )
    until(lambda: note.exists() and note.read_text())
    gate.kill()
    gate.wait()
    until(lambda: not _runs(int(note.read_text())))
    assert len(list(temporary.iterdir())) == 2
    with temporary_folder(temporary) as folder:

        def names() -> list[str]:
            with temporary_folder(temporary) as other:
                assert folder.is_dir()
                assert other.is_dir()
            return sorted(path.name for path in temporary.iterdir())

        until(lambda: names() == sorted([folder.parent.name, ".reference_rt-of-a-user"]))
    assert [path.name for path in temporary.iterdir()] == [".reference_rt-of-a-user"]


def until(holds: Callable[[], Any]) -> None:
    """Wait for it; where it never comes pytest's own time limit ends the test."""
    while not holds():
        time.sleep(0.02)


def _runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (ProcessLookupError, FileNotFoundError):
        return False
    return state != "Z"


def test_placeholders(tmp_path: Path) -> None:
    full = Command("a '{scene} x' -o{output} --seed={seed} {spp} {other", Path("a b.yaml"), 16)
    assert full.arguments(Path("/o/p.exr"), 3) == [
        "a",
        "a b.yaml x",
        "-o/o/p.exr",
        "--seed=3",
        "16",
        "{other",
    ]
    for template, message in (
        ("render {output} {sed}", "there is no {sed}; expected some of {scene}, {output}, {seed}"),
        ("render {scene}", "has no {output}; expected it as the picture's file name"),
        ("render {output} {scene}", "has {scene}; expected --scene too"),
        ("render {output} {spp}", "has {spp}; expected --spp too"),
        ("render '{output}", "no closing quotation; expected closed quotes"),
        ("", "is empty; expected a program"),
    ):
        with pytest.raises(UsageError, match=f"--command: {message}"):
            Driver(Command(template), tmp_path)


def test_a_shell_is_not_there(renderer: str, tmp_path: Path) -> None:
    template = f"{renderer} well {{output}} {{seed}} ; touch {tmp_path / 'touched'} $(touch b)"
    Driver(Command(template, suffix=".npy"), tmp_path / "kept").pictures(range(1))
    assert not (tmp_path / "touched").exists()
    with pytest.raises(RendererError, match="no-such-program: cannot be started: No such file"):
        Driver(Command("no-such-program {output}"), tmp_path / "kept").pictures(range(1))

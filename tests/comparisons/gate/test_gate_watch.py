"""`gate --watch`: judges again when a candidate was written, and leaves whole outputs."""

import json
import signal
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import invoke
from gate_checks import write
from typer.testing import Result

from comparisons.gate.request import Request
from reference_rt.cli import watching
from reference_rt.util.processes import Terminated

RIGHT = np.random.default_rng(1).uniform(0.2, 1.0, (8, 12, 3))
ASKED = ("gate", "c.exr", "--reference", "right.exr", "--noise-free", "--watch")


@pytest.fixture
def gate(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Callable[[Sequence[Callable[[], Any]]], Result]:
    """`gate --watch`, with something that happens at each look at the files; then Ctrl-C."""
    monkeypatch.chdir(tmp_path)
    write("right.exr", RIGHT)

    def run(steps: Sequence[Callable[[], Any]]) -> Result:
        left = iter(steps)

        def sleep(seconds: float) -> None:
            assert seconds == watching.POLLED
            step = next(left, None)
            if step is None:
                raise KeyboardInterrupt
            step()

        monkeypatch.setattr(watching.time, "sleep", sleep)
        return invoke(*ASKED)

    return run


@pytest.mark.parametrize(
    ("interruption", "code"),
    [
        (KeyboardInterrupt(), 1),
        (Terminated(signal.SIGINT), 1),
        (Terminated(signal.SIGTERM), 143),
        (Terminated(signal.SIGHUP), 129),
    ],
)
def test_only_ctrl_c_ends_it_with_the_last_verdict(
    gate: Any, interruption: KeyboardInterrupt, code: int
) -> None:
    """Who ends it otherwise, such as a supervisor, is told so: by no verdict."""
    write("c.exr", 1.25 * RIGHT)

    def end() -> None:
        raise interruption

    assert gate([nothing, end]).exit_code == code
    assert verdict() == "differ"


def nothing() -> None:
    """Has happened."""


def verdict() -> str:
    return str(json.loads(Path("out/results.json").read_text())["cases"][0]["verdict"])


def test_it_judges_whenever_the_candidate_was_written(gate: Any) -> None:
    write("c.exr", RIGHT)
    seen: list[str] = []

    def look() -> None:
        seen.append(verdict())

    steps = [
        nothing,
        look,
        lambda: write("c.exr", 1.25 * RIGHT),
        nothing,  # settled: judged before the next look
        look,
        lambda: write("c.exr", RIGHT),
        nothing,
        look,
        lambda: write("right.exr", 2.0 * RIGHT),  # the reference counts, too
        nothing,
        look,
    ]
    result = gate(steps)
    assert seen == ["unchanged", "differ", "unchanged", "differ"]
    assert result.exit_code == 1  # of the last verdict
    lines = [line for line in result.stdout.splitlines() if line.startswith("right: ")]
    assert [line.split(": ")[1] for line in lines] == seen
    assert "constant gain of 1.25" in lines[1]


def test_a_candidate_that_is_being_written_is_waited_for(gate: Any) -> None:
    write("c.exr", RIGHT)
    whole = Path("c.exr").read_bytes()
    other = Path(write("d.exr", 1.25 * RIGHT)).read_bytes()

    def begin(size: int) -> Callable[[], Any]:
        return lambda: Path("c.exr").write_bytes(other[:size])

    def now_whole() -> None:
        assert verdict() == "unchanged"
        Path("c.exr").write_bytes(other)

    steps = [begin(10), begin(100), Path("c.exr").unlink, nothing, now_whole, nothing]
    result = gate(steps)
    assert whole != other
    assert verdict() == "differ"
    assert "error" not in result.output


def test_a_broken_candidate_is_told_and_the_next_one_judged(gate: Any) -> None:
    write("c.exr", RIGHT)
    steps = [lambda: Path("c.exr").write_bytes(b"no"), nothing, nothing]
    result = gate([*steps, lambda: write("c.exr", RIGHT), nothing])
    assert "error: c.exr: " in result.stderr
    assert result.exit_code == 0
    assert verdict() == "unchanged"
    assert gate(steps).exit_code == 3


def test_an_interruption_while_judging_keeps_the_outputs_of_before(
    gate: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    write("c.exr", RIGHT)

    def interrupted(*arguments: Any, **named: Any) -> Any:
        raise KeyboardInterrupt

    def other() -> None:
        write("c.exr", 1.25 * RIGHT)
        monkeypatch.setattr(Request, "__post_init__", interrupted)

    result = gate([other, nothing, nothing])
    assert result.exit_code == 130
    assert "interrupted; nothing unfinished was written" in result.stderr
    assert verdict() == "unchanged"
    assert {path.name for path in Path("out").iterdir()} == {"results.json", "report.html"}


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--command", "x {output}", "--watch"], "--watch: waits for files; expected candidates"),
        (["a.exr", "--truth", "disk_lamp", "--watch"], "--watch: does not apply to --truth"),
        (["--pair", "a", "b", "--watch"], "--watch: does not apply to --pair"),
    ],
)
def test_what_has_no_files_to_wait_for_is_refused(words: list[str], told: str) -> None:
    result = invoke("gate", *words)
    assert result.exit_code == 2
    assert told in result.stderr

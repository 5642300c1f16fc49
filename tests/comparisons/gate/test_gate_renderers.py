"""The gate drives a renderer: right, wrong and failing ones."""

import shlex
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gate_checks import run
from typer.testing import Result

from reference_rt.core.arrays import FloatArray

pytestmark = pytest.mark.usefixtures("gate_folder")


RENDERER = """\
import sys, time
from pathlib import Path
import numpy as np
how, output, seed = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])
if how == "hangs":
    time.sleep(6000)
if how == "crashes":
    sys.exit("out of light")
if how in ("right", "wrong"):
    picture = np.load("right.npy")[int(output.stem[-2:])]
    with output.open("wb") as file:
        np.save(file, picture if how == "right" else 1.05 * picture)
if how == "beside":
    np.save(output.with_name("other.npy"), np.ones((2, 2, 3)))
if how == "stale":
    np.save("candidate-00.npy", np.load("right.npy")[0])
"""


def drive(how: str, *more: str) -> tuple[Result, Any]:
    Path("renderer.py").write_text(RENDERER)
    command = (
        f"{shlex.quote(sys.executable)} renderer.py {how} {{output}} {{seed}} {{scene}} {{spp}}"
    )
    return run("--command", command, "--scene", "ball.yaml", "--suffix", ".npy", *more)


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("how", "code", "verdict"), [("right", 0, "agree"), ("wrong", 1, "differ")]
)
def test_a_renderer_is_driven(right: FloatArray, how: str, code: int, verdict: str) -> None:
    np.save("right.npy", right)
    result, found = drive(how, "--replicates", "4")
    assert result.exit_code == code, result.output
    assert found["cases"][0]["verdict"] == verdict
    assert "candidate 4, seed 1834170008" in result.output
    assert len(list(Path("out/candidates").iterdir())) == 4
    assert found["provenance"]["command"].endswith("{output} {seed} {scene} {spp}")


@pytest.mark.cases(4)
@pytest.mark.parametrize(
    ("how", "message"),
    [
        ("hangs", "exceeded the time limit of 1 s with seed 1, and was killed"),
        ("crashes", "failed with seed 1: exit code 1, expected 0; it said: out of light"),
        (
            "nothing",
            "ended without an error with seed 1, but wrote no file; expected candidate-00.npy",
        ),
        ("beside", "wrote another file with seed 1: other.npy in the same folder"),
        ("stale", "wrote another file with seed 1: candidate-00.npy in the working folder"),
    ],
)
def test_a_renderer_that_fails(right: FloatArray, how: str, message: str) -> None:
    np.save("right.npy", right)
    Path("out/candidates").mkdir(parents=True)  # as an earlier run leaves them
    np.save("out/candidates/candidate-00.npy", right[0])
    result, found = drive(how, "--time-limit", "1" if how == "hangs" else "600")
    assert result.exit_code == 4, result.output
    assert message in result.output
    assert message in found["cases"][0]["reason"]
    assert found["cases"][0]["verdict"] == "not-comparable"
    assert [path.name for path in Path("out/candidates").iterdir()] == ["renderer.log"]

"""Standard output and error that cannot be written: one line where one can be seen, and the exit
code that the documentation promises."""

import os
import subprocess
import sys

import pytest
from builders import SCENES

PROGRAM = [sys.executable, "-c", "from reference_rt.cli.main import main; main()"]
EXPLAIN = ["explain", str(SCENES / "spheres_whitted.yaml")]
PRINTING = (EXPLAIN, ["schema"], ["--help"], ["gate", "--help"], [])

pytestmark = pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a full device")  # noqa: PTH110


@pytest.mark.cases(2)
@pytest.mark.parametrize("arguments", PRINTING, ids=" ".join)
def test_a_full_disk(arguments):
    with open("/dev/full", "w") as full:  # noqa: PTH123
        done = subprocess.run(
            [*PROGRAM, *arguments], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.stderr == (
        "error: standard output cannot be written: No space left on device; expected free space\n"
    )
    assert done.returncode == 3


@pytest.mark.cases(1)
@pytest.mark.parametrize("arguments", [EXPLAIN, ["schema"], ["--help"]], ids=" ".join)
def test_a_reader_that_has_gone(arguments):
    """As `| head` goes: nothing is said."""
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(
        [*PROGRAM, *arguments], stdout=write, stderr=subprocess.PIPE, text=True, check=False
    )
    os.close(write)
    assert done.stderr == ""
    assert done.returncode == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "code"),
    [(["explain", "no.yaml"], 3), (["render", "no.yaml", "-o", "a.txt"], 2), (EXPLAIN, 3)],
)
def test_standard_error_is_full_too(arguments, code):
    """The exit code still tells."""
    with open("/dev/full", "w") as full:  # noqa: PTH123
        done = subprocess.run([*PROGRAM, *arguments], stdout=full, stderr=full, check=False)
    assert done.returncode == code

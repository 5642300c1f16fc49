"""Whatever bytes a file has: every reader of meshes, images and scenes reads it, or says why not in
one line that names the file.  Nothing hangs, takes the machine's memory or ends the process."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

HELPER = Path(__file__).parents[2] / "helpers" / "reader_mutations.py"


@pytest.mark.parametrize(
    ("seed", "count"), [(1, 94), pytest.param(2, 30_000, marks=pytest.mark.slow)]
)
def test_damaged_files(seed: int, count: int) -> None:
    pytest.importorskip("DracoPy")
    pytest.importorskip("meshopt")
    command = [sys.executable, str(HELPER), str(seed), str(count)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"ended with {done.returncode} in {done.stderr[-2000:]}"
    result = json.loads(done.stdout)
    assert result["wrong"] == []
    assert result["cases"] == count
    assert result["read"] > count // 20  # some damages leave a sound file

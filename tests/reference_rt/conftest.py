"""Fixtures of all tests of `reference_rt`."""

from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import invoke
from hypothesis import settings

# The same examples in every run, and no promise of speed: kernels compile inside the first.
settings.register_profile("fixed", derandomize=True, database=None, deadline=None)
settings.load_profile("fixed")


@pytest.fixture
def refused(tmp_path: Path) -> Callable[..., str]:
    """refused(exit_code, *arguments) runs the program, checks that it fails with this code, one
    line, no traceback and nothing written, and returns the line without its "error: "."""

    def run(exit_code: int, *arguments: str) -> str:
        before = sorted(tmp_path.rglob("*"))
        result = invoke(*arguments)
        assert result.exit_code == exit_code, result.stderr
        assert sorted(tmp_path.rglob("*")) == before
        assert result.stdout == ""
        assert result.stderr.startswith("error: ")
        assert result.stderr.endswith("\n")
        assert result.stderr.count("\n") == 1, result.stderr
        assert "Traceback" not in result.stderr
        assert "internal" not in result.stderr
        return result.stderr.removeprefix("error: ").rstrip("\n")

    return run

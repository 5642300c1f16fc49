"""Fixtures of the tests of commands."""

import subprocess
from pathlib import Path
from typing import Any

import pytest
from command_line import WorkBegan

import comparisons.mitsuba.backend
import comparisons.translator.derivative  # which would keep what stands for `mitsuba` below
import reference_rt.rendering.executor
import reference_rt.scene.build


@pytest.fixture
def idle(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Whatever takes long raises, and the working folder is the test's own."""

    def refuse(*_: Any, **__: Any) -> Any:
        raise WorkBegan

    for module, name in (
        (reference_rt.scene.build, "build_tables"),
        (comparisons.mitsuba.backend, "mitsuba"),
        (subprocess, "Popen"),
        (subprocess, "run"),
    ):
        monkeypatch.setattr(module, name, refuse)
    for name in ("CI", "GITHUB_ACTIONS", "GITHUB_STEP_SUMMARY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(tmp_path)

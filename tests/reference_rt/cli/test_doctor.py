"""`reference-rt doctor` and `--version`."""

import importlib.metadata

import pytest
from command_line import invoke

from comparisons.commands import doctor as of_comparisons
from comparisons.mitsuba import backend
from reference_rt.cli import doctor
from reference_rt.cli.doctor import Check
from reference_rt.util.errors import ReferenceUnavailableError


def entry(name, function):
    class Entry:
        def load(self):
            return function

    Entry.name = name
    return Entry()


@pytest.fixture
def others(monkeypatch):
    """Replaces the checks of other packages."""

    def replace(*entries):
        monkeypatch.setattr(
            doctor.importlib.metadata, "entry_points", lambda group: entries if group else ()
        )

    return replace


def test_version():
    done = invoke("--version")
    assert done.exit_code == 0
    assert done.stdout == f"reference_rt {importlib.metadata.version('reference-rt')}\n"


def test_help_keeps_the_exit_codes():
    done = invoke("--help")
    assert "Exit codes" in done.stdout
    assert "doctor" in done.stdout


def test_all_is_named():
    done = invoke("doctor")
    assert done.exit_code == 0
    for what in ("reference_rt", "machine", "compiler", "kernels", "Mitsuba"):
        assert f"  {what}: " in done.stdout
    assert "FAIL" not in done.stdout


def test_what_does_not_work_has_an_exit_code_and_advice(others):
    others(entry("x", lambda: [Check("engine", "stalled", "crank it", works=False)]))
    done = invoke("doctor")
    assert done.exit_code == 1
    assert "FAIL  engine: stalled\n      -> crank it\n" in done.stdout


def test_a_check_that_raises_hides_no_other(others):
    def fails():
        raise RuntimeError("no\nspark")

    others(entry("broken", fails), entry("x", lambda: [Check("engine", "runs")]))
    done = invoke("doctor")
    assert done.exit_code == 1
    assert "FAIL  broken: RuntimeError: no spark\n" in done.stdout
    assert "ok    engine: runs\n" in done.stdout


def test_the_slow_variant_is_a_note_and_none_a_failure(monkeypatch):
    slow = backend.Backend(backend.SCALAR, "3.9.1", "no libLLVM was found", None)
    monkeypatch.setattr(backend, "choose", lambda: slow)
    check, *_ = of_comparisons.checks()
    assert check.works
    assert "no libLLVM" in check.advice

    def missing():
        raise ReferenceUnavailableError("Mitsuba is not installed; expected: pip install ...")

    monkeypatch.setattr(backend, "choose", missing)
    check, *_ = of_comparisons.checks()  # without FLIP's package there is a line of that
    assert not check.works
    assert "pip install" in check.advice


def test_what_slows_down_is_a_note(monkeypatch, others):
    others()
    monkeypatch.setattr(doctor, "CACHE_FOLDER", None)
    lines = [*doctor.page(doctor.checks())]
    noted = [line for line in lines if line.startswith("note")]
    assert any("cannot be written" in line for line in noted)
    assert not any(line.startswith("FAIL") for line in lines)

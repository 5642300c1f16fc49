"""Without the packages of the extras: one line that names all of them, and how to install them."""

import importlib.metadata
import json
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from builders import HELPERS
from command_line import SCENE

from reference_rt.util import extras

ROOT = Path(__file__).parents[3]

BROUGHT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]

PLAIN = {
    extra: [re.split(r"[^\w.-]", package)[0] for package in packages if ";" not in package]
    for extra, packages in BROUGHT.items()
}
"""The packages of each extra without a condition, which nothing does without."""

USERS = ("compare", "browser", "cluster")
"""Extras for users of the program."""

HIDDEN = """
import importlib.metadata, json, os, sys
packages, modules, lines = json.loads(sys.argv[1])
sys.modules.update(dict.fromkeys(modules))
found = importlib.metadata.distribution
def distribution(name):
    if name in packages:
        raise importlib.metadata.PackageNotFoundError(name)
    return found(name)
importlib.metadata.distribution = distribution
"""
"""Hides packages: their modules cannot be imported, and they are not among those installed."""

COMMANDS = (
    HIDDEN
    + """
from command_line import ARGUMENTS, SCENE, invoke
NO_EXTRA = "render", "derivative", "trace", "warm-up", "preview"
Found = {}
for command, needed in [*ARGUMENTS.items(), *((line[0], line[1:]) for line in lines)]:
    if needed == ARGUMENTS[command] and command in NO_EXTRA:
        continue  # they compile kernels
    more = {"render": ["-o", "x.exr"], "convert": ["-o", "x.xml"]}.get(command, [])
    scene = [SCENE] if command == "render" and SCENE not in needed else []
    result = invoke(command, *scene, *needed, *more, "--size", "4x3")
    if "No such option" in result.output:
        result = invoke(command, *scene, *needed, *more)
    Found[" ".join([command, *needed])] = result.exit_code, result.output
print(json.dumps(Found))
"""
)

LINES = [
    ["render", "--scheduler", "tcp://127.0.0.1:1"],
    ["render", "--cluster", "slurm.yaml"],
    ["render", "no.xml"],
    ["explain", "scene.yaml", "--witness", "cycles"],
    ["selftest", "--mutants", "2"],
]


WORKING = [f"explain {SCENE}", f"check {SCENE}", "schema"]
"""They need none."""


@cache
def installed() -> Mapping[str, list[str]]:
    """The packages of each module that can be imported."""
    return importlib.metadata.packages_distributions()


def modules_of(packages: list[str]) -> list[str]:
    """What can be imported of packages; the names of those that are not installed are guessed."""
    wanted = {package.lower() for package in packages}
    found = {module for module, of in installed().items() if {o.lower() for o in of} & wanted}
    return sorted(found | {package.replace("-", "_") for package in packages})


def without(program: str, folder: Path, lines: Any = ()) -> str:
    packages = [package for extra in USERS for package in PLAIN[extra]]
    given = json.dumps([packages, modules_of(packages), lines])
    run = subprocess.run(
        [sys.executable, "-c", program, given],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{HELPERS}"},
    )
    assert run.returncode == 0, run.stderr
    return run.stdout


def listed(extra: str) -> str:
    *first, last = PLAIN[extra]
    return f"{', '.join(first)} and {last}" if first else last


def test_every_command_names_all_that_it_lacks(tmp_path: Path) -> None:
    (tmp_path / "slurm.yaml").write_text("type: slurm\njobs: 1\n")
    (tmp_path / "no.xml").write_text('<scene version="3.0.0"></scene>')
    (tmp_path / "scene.yaml").write_text("shapes: [{type: sphere}]")
    found = json.loads(without(COMMANDS, tmp_path, LINES))
    lacking = {}
    for command, (code, output) in found.items():
        assert "internal error" not in output, command
        assert "Traceback" not in output, command
        if told := re.search(r"needs (.*): pip install 'reference-rt\[(\w+)\]'", output):
            lacking[command] = code
            assert told[1] == listed(told[2]), command
    compare = [command for command, code in lacking.items() if code == 4]
    assert len(compare) >= 14
    assert len(lacking) - len(compare) == 2  # of a cluster
    assert [command for command, (code, _) in found.items() if code == 0] == WORKING


FIXTURES = (
    HIDDEN
    + """
import pytest
from pathlib import Path
Path("test_it.py").write_text(
    "def test_one(image_gate): image_gate([], scene='a.yaml')\\n"
    "def test_two(truth_gate): truth_gate('perspective', [])\\n"
)
plugins = ["comparisons.gate.pytest_plugin", "comparisons.truth.pytest_plugin"]
loaded = [word for name in plugins for word in ("-p", name)]
os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
pytest.main(["-q", "-p", "no:cacheprovider", *loaded])
"""
)


def test_so_do_the_fixtures(tmp_path: Path) -> None:
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    said = without(FIXTURES, tmp_path)
    for fixture in ("image_gate", "truth_gate"):
        line = (
            f"E   Failed: {fixture} needs {listed('compare')}: pip install 'reference-rt[compare]'"
        )
        assert said.count(line) == 1, said
    assert "Traceback" not in said
    assert "ModuleNotFoundError" not in said


def test_so_does_a_page(tmp_path: Path) -> None:
    program = (
        HIDDEN + "import runpy; sys.argv = ['browser', 'a.html', '-', 'o', '1', '-', '-', '-']\n"
    )
    program += "try: runpy.run_module('comparisons.gate.browser', run_name='__main__')\n"
    program += "except SystemExit as ended: print(ended)\n"
    said = without(program, tmp_path)
    assert said == "a page needs playwright: pip install 'reference-rt[browser]'\n"


def test_extras_are_those_that_are_declared() -> None:
    """And every module that the program imports of them is known by its extra."""
    assert {*extras.requirements()} >= {(extra, p) for extra in USERS for p in PLAIN[extra]}
    for module, extra in (("skimage.metrics", "compare"), ("flint", "compare")):
        assert extras.extra_of(module) == extra
    for extra in USERS:
        for package in PLAIN[extra]:
            brought = {extras.extra_of(module) for module in modules_of([package])}
            assert extra in brought, package
    assert extras.extra_of("nowhere") is extras.extra_of(None) is None


def test_one_that_no_extra_names_is_named_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extras, "requirements", lambda: iter(()))
    assert extras.needs("it", "compare", "a.b") == "it needs a: pip install 'reference-rt[compare]'"

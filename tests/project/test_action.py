"""The packaged GitHub Action and the image: their shell commands do what they say, and the example
in the documentation fits them."""

import os
import re
import subprocess
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "action.yml").read_text(encoding="utf-8")
ACTION = yaml.safe_load(TEXT)
STEPS = {step["name"]: step for step in ACTION["runs"]["steps"] if "name" in step}


def test_the_inputs_are_declared_used_and_described():
    assert set(re.findall(r"inputs\.([\w-]+)", TEXT)) == set(ACTION["inputs"])
    for given in ACTION["inputs"].values():
        assert given["description"].endswith(".")
        assert given.get("required") or given["default"]


@pytest.fixture
def run(tmp_path):
    """run(step, values): a step's shell commands with these values of its environment."""

    def run(name, **values):
        step = STEPS[name]
        assert set(values) == set(step["env"])
        environment = os.environ | {key: str(value) for key, value in values.items()}
        return subprocess.run(
            ["bash", "-eo", "pipefail", "-c", step["run"]],
            env=environment, cwd=tmp_path, capture_output=True, text=True,
        )  # fmt: skip

    return run


def script(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o700)


@pytest.mark.parametrize("extras", ["compare", ""])
def test_it_installs_into_an_environment_of_its_own(run, tmp_path, extras):
    venv = tmp_path / "a b" / "venv"
    script(tmp_path / "python", 'echo "$@" >> made')
    script(venv / "bin" / "pip", 'echo "$3" >> made')
    done = run("install", PYTHON=tmp_path / "python", SOURCE="/the source", EXTRAS=extras,
               VENV=venv)  # fmt: skip
    assert done.returncode == 0, done.stderr
    source = "/the source[compare]" if extras else "/the source"
    assert (tmp_path / "made").read_text() == f"-m venv {venv}\n{source}\n"


def test_it_runs_the_commands_with_the_cache_and_fails_with_them(run, tmp_path):
    script(tmp_path / "bin" / "reference-rt", 'echo "$REFERENCE_RT_CACHE: $@"; [ "$1" != gate ]')
    given = {"VENV": tmp_path, "REFERENCE_RT_CACHE": tmp_path / "kernels"}
    done = run("run", COMMANDS='reference-rt warm-up\nreference-rt suite "a b"', **given)
    assert done.stdout == f"{tmp_path}/kernels: warm-up\n{tmp_path}/kernels: suite a b\n"
    assert done.returncode == 0
    for commands in ("reference-rt gate\necho no", "reference-rt gate | cat\necho no"):
        done = run("run", COMMANDS=commands, **given)
        assert done.returncode == 1
        assert "no" not in done.stdout


def test_the_image_has_what_the_package_is_built_from():
    kept = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    sent = {line[1:] for line in kept if line.startswith("!")}
    built = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    project = built["project"]
    packages = {
        name.rstrip("*") for name in built["tool"]["setuptools"]["packages"]["find"]["include"]
    }
    needed = {"pyproject.toml", project["readme"], *project["license-files"], *packages}
    assert sent == needed
    assert kept[0] == "*"
    assert all((ROOT / name).exists() for name in sent)

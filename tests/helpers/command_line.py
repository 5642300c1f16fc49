"""`reference-rt` in this process, with the commands of all installed packages."""

from pathlib import Path
from typing import Any

from typer import testing
from typer.main import get_command
from typer.testing import CliRunner, Result

from reference_rt.cli.main import _add_commands, app

_add_commands()

COMMAND = get_command(app)

# Typer would make all commands and their options anew, for 11 ms of a run of the program.
testing._get_command = lambda program: COMMAND if program is app else get_command(program)  # type: ignore[attr-defined]


def invoke(*words: Any, catch_exceptions: bool = True, **environment: str) -> Result:
    """Run the program with these words, and these environment variables in addition.

    catch_exceptions: whether one that the program does not handle is part of the result.
    """
    arguments = [str(word) for word in words]
    return CliRunner().invoke(app, arguments, env=environment, catch_exceptions=catch_exceptions)


SCENE = str(Path(__file__).parents[2] / "scenes" / "spheres_whitted.yaml")

BOX = str(Path(SCENE).with_name("cornell_box.yaml"))

COMMANDS = {c.name or c.callback.__name__: c.callback for c in app.registered_commands}

ARGUMENTS = {
    "render": [SCENE],
    "compare": [SCENE],
    "suite": ["smoke", "--scenes", str(Path(SCENE).parent)],
    "gate": ["no.exr", "--scene", SCENE],
    "accept": ["no.exr", "--name", "room", "--reason", "right"],
    "report": ["run"],
    "selftest": ["--scenes", str(Path(SCENE).parent)],
    "converge": [SCENE],
    "methods": [],
    "bench": ["--scenes", str(Path(SCENE).parent)],
    "stability": [],
    "derivative": [SCENE, "camera.eye[0]"],
    "derivatives": ["--scenes", str(Path(SCENE).parent)],
    "explain": [SCENE],
    "convert": [SCENE],
    "preview": [SCENE],
    "trace": [SCENE, "--pixel", "1,1"],
    "fuzz": ["--count", "1"],
    "truth": ["perspective", "--scenes", str(Path(SCENE).parent / "truth")],
    "variants": [
        str(Path(SCENE).with_name("cornell_box.yaml")),
        "--variant",
        "scalar_rgb",
        "--variant",
        "llvm_ad_rgb",
    ],
    "versions": ["3.9.1", "3.9.1", "--scene", str(Path(SCENE).with_name("cornell_box.yaml"))],
    "doctor": [],
    "check": [SCENE],
    "schema": [],
    "warm-up": [],
}
"""What each command needs besides its outputs."""


class WorkBegan(BaseException):
    """Not an Exception, which commands would tell of as their own."""

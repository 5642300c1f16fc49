"""`reference-rt` in this process, with the commands of all installed packages."""

from typing import Any

from typer.testing import CliRunner, Result

from reference_rt.cli.main import _add_commands, app

_add_commands()


def invoke(*words: Any, catch_exceptions: bool = True, **environment: str) -> Result:
    """Run the program with these words, and these environment variables in addition.

    catch_exceptions: whether one that the program does not handle is part of the result.
    """
    arguments = [str(word) for word in words]
    return CliRunner().invoke(app, arguments, env=environment, catch_exceptions=catch_exceptions)

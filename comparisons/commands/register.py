"""The commands that `comparisons` adds to `reference-rt`."""

import typer

from comparisons.commands.accept import accept
from comparisons.commands.bench import bench
from comparisons.commands.compare import compare
from comparisons.commands.converge import converge
from comparisons.commands.convert import convert
from comparisons.commands.fuzz import fuzz
from comparisons.commands.gate import gate
from comparisons.commands.methods import methods
from comparisons.commands.report import report
from comparisons.commands.selftest import selftest
from comparisons.commands.stability import stability
from comparisons.commands.suite import suite
from comparisons.commands.truth import truth


def register(app: typer.Typer) -> None:
    """Add the commands; called through the entry-point group `reference_rt.commands`."""
    commands = (
        *(compare, suite, gate, accept, report, selftest),
        *(converge, methods, bench, stability, convert, fuzz, truth),
    )
    for command in commands:
        app.command()(command)

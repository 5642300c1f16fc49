"""The commands that `comparisons` adds to `reference-rt`."""

import typer

from comparisons.commands.accept import accept
from comparisons.commands.back_ends import variants, versions
from comparisons.commands.compare import compare, convert, report, suite
from comparisons.commands.derivatives import derivatives
from comparisons.commands.gate import gate
from comparisons.commands.speed import bench, converge, methods
from comparisons.commands.trials import fuzz, selftest, stability
from comparisons.commands.truth import truth


def register(app: typer.Typer) -> None:
    """Add the commands; called through the entry-point group `reference_rt.commands`."""
    commands = (
        *(compare, suite, gate, accept, report, selftest),
        *(converge, methods, bench, stability, convert, fuzz, truth, derivatives),
        *(variants, versions),
    )
    for command in commands:
        app.command()(command)

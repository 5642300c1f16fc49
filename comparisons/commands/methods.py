"""`reference-rt methods`."""

from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

from comparisons.commands.options import compare_extra, out_folder
from reference_rt.cli.guarded import guarded, say
from reference_rt.util.errors import UsageError


@guarded
def methods(
    out: Annotated[Path, out_folder("results and the page", "DIR")] = Path("out/methods"),
    family: Annotated[
        list[str] | None,
        typer.Option(help="Only these: sphere, triangle, box, polygon, csg, hierarchy."),
    ] = None,
    full: Annotated[
        bool, typer.Option("--full/--quick", help="More rays and runs: minutes instead of one.")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the random shapes and rays.")] = 1,
) -> None:
    """Time the textbook's intersection methods, in nanoseconds per ray."""
    with compare_extra("measuring"):
        from comparisons.experiments.methods.outputs import table, write, write_page
        from comparisons.experiments.methods.run import FULL, QUICK, run
        from comparisons.experiments.methods.trials import FAMILIES
        from comparisons.runs.provenance import ours

        import_module("matplotlib")  # before minutes of measuring that the page then cannot show
    from comparisons.report import terminal
    from reference_rt.util.console import ProgressLine
    from reference_rt.util.files import check_writable

    names = list(dict.fromkeys(family or FAMILIES))
    if unknown := [name for name in names if name not in FAMILIES]:
        raise UsageError(f"--family: expected one of {', '.join(FAMILIES)}, got '{unknown[0]}'")
    page = out / "methods.html"
    check_writable(out / "results.json", out / "results.csv", page)
    effort, about = FULL if full else QUICK, ours()
    rows = []
    with ProgressLine() as progress:
        for name in names:
            rows += run(name, effort, seed, progress)
            write(out, rows, effort, seed, about)
        progress("page", 0.0)
        write_page(page, rows, effort, seed, about)
        progress("page", 1.0)
    console = terminal.console()
    for name in names:
        console.print(table([row for row in rows if row.family == name], console.width))
        console.print()
    say(f"{out / 'results.json'}, results.csv, methods.html", err=True)

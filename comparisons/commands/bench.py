"""`reference-rt bench`."""

from pathlib import Path
from typing import Annotated

import typer

from comparisons.commands.options import Fresh, Scenes, compare_extra, out_folder, table_in
from reference_rt.cli.guarded import guarded, say
from reference_rt.util.errors import UsageError


@guarded
def bench(
    out: Annotated[Path, out_folder("results.json and bench.md")] = Path("out/bench"),
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="ROW", help="Only these rows, and those measured together with them."),
    ] = None,
    mesh: Annotated[
        Path | None,
        typer.Option(help="An .obj or .ply file to trace rays in. (default: a generated mesh)"),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Smaller pictures and fewer scenes.")
    ] = False,
    fresh: Fresh = False,
    markdown: Annotated[Path | None, table_in("bench")] = None,
    scenes: Scenes = Path("scenes"),
) -> None:
    """Measure the renderer's speed against Mitsuba's; takes about half an hour."""
    with compare_extra():
        from comparisons.experiments.bench import table
        from comparisons.experiments.bench.groups import chosen
        from comparisons.experiments.bench.run import run
        from comparisons.experiments.bench.setting import Setting
        from comparisons.experiments.bench.table import Display
        from comparisons.report import templates, terminal

    groups = chosen(only or ())
    if mesh is not None and not mesh.is_file():
        raise UsageError(f"--mesh: there is no file '{mesh}'")
    if markdown is not None:
        templates.check(markdown, "bench")
    with Display() as display:
        setting = Setting(scenes=scenes, mesh=mesh, quick=quick, say=display.say)
        outcome = run(groups, setting, out, display, fresh)
    console = terminal.console()
    console.print(table.terminal(outcome.rows, console.width))
    if markdown is not None:
        written = table.markdown(outcome.rows, outcome.machine, outcome.not_measured)
        templates.rewrite(markdown, "bench", written)
    for name, why in outcome.not_measured.items():
        say(f"{name}: not measured: {why}", err=True)
    say(f"{out / 'results.json'}, {out / 'bench.md'}", err=True)
    raise typer.Exit(0 if outcome.met else 1)

"""Commands that measure speed: `reference-rt bench`, `methods` and `converge`."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

from comparisons.commands.options import (
    ClusterFile,
    Fresh,
    Plots,
    Scenes,
    Scheduler,
    compare_extra,
    out_folder,
    some_of,
    table_in,
)
from reference_rt.cli.guarded import guarded, say
from reference_rt.cli.options import Defaults, by_name, duration
from reference_rt.cli.quantities import seconds_of, size_of
from reference_rt.util.errors import SceneError, UsageError, printable


@guarded
def bench(
    out: Annotated[Path, out_folder("results.json and bench.md")] = Path("out/bench"),
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ROW", help="Only these rows or scenes, and rows measured together with them."
        ),
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
        from comparisons.commands.outputs import Outputs
        from comparisons.experiments.bench import outputs
        from comparisons.experiments.bench.row import Setting
        from comparisons.experiments.bench.run import all_groups, chosen, run
        from comparisons.report import terminal

    setting = Setting(scenes=scenes, mesh=mesh, quick=quick)
    groups = chosen(only or (), all_groups(setting))
    if mesh is not None and not mesh.is_file():
        raise UsageError(f"--mesh: there is no file '{mesh}'")
    writes = Outputs(out, ("results.json", "bench.md"), ("rows",), (markdown, "bench"))
    writes.check()
    with outputs.Display() as display:
        outcome = run(groups, replace(setting, say=display.say), out, display, fresh)
    console = terminal.console()
    console.print(outputs.terminal(outcome.rows, console.width))
    for name, why in outcome.not_measured.items():
        say(f"{name}: not measured: {why}", err=True)
    writes.finish(lambda: outputs.markdown(outcome.rows, outcome.machine, outcome.not_measured))
    raise typer.Exit(0 if outcome.met else 1)


@guarded
def methods(
    out: Annotated[Path, out_folder("results and the page", "DIR")] = Path("out/methods"),
    family: Annotated[
        list[str] | None,
        typer.Option(help="Only these: sphere, triangle, box, polygon, csg, hierarchy, picture."),
    ] = None,
    full: Annotated[
        bool, typer.Option("--full/--quick", help="More rays and runs: minutes instead of one.")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the random shapes and rays.")] = 1,
) -> None:
    """Time the textbook's intersection methods, in nanoseconds per ray."""
    with compare_extra("measuring"):
        from comparisons.commands.outputs import Outputs
        from comparisons.experiments.methods.outputs import terminal as table_of
        from comparisons.experiments.methods.outputs import write, write_page
        from comparisons.experiments.methods.run import FAMILIES, FULL, QUICK, run
        from comparisons.runs.provenance import ours

        import_module("matplotlib")  # before minutes of measuring that the page then cannot show
    from comparisons.report import terminal
    from reference_rt.util.console import ProgressLine

    names = some_of("--family", family, FAMILIES)
    writes = Outputs(out, ("results.json", "results.csv", "methods.html"))
    writes.check()
    effort, about = FULL if full else QUICK, ours()
    rows = []
    with ProgressLine() as progress:
        for name in names:
            rows += run(name, effort, seed, progress)
            write(out, rows, effort, seed, about)
        progress("page", 0.0)
        write_page(writes.files[-1], rows, effort, seed, about)
        progress("page", 1.0)
    console = terminal.console()
    for name in names:
        console.print(table_of([row for row in rows if row.family == name], console.width))
        console.print()
    writes.finish()


@guarded
def converge(
    scenes: Annotated[
        list[Path], typer.Argument(metavar="SCENE...", help="Scene files: .yaml, .json or .xml.")
    ],
    out: Annotated[Path, out_folder("results.json, .csv and report.html", "DIR")] = Path(
        "out/converge"
    ),
    time_limit: Annotated[str, duration("For all pictures and the reference of one scene")] = "60s",
    size: Annotated[
        str | None,
        typer.Option(
            metavar="WIDTHxHEIGHT", help="In pixels. (default: the scene's, at most 128 wide)"
        ),
    ] = None,
    max_spp: Annotated[
        int, typer.Option(min=4, help="Maximum samples per pixel of the last rung.")
    ] = 4096,
    replicates: Annotated[int, typer.Option(min=2, help="Independent pictures per rung.")] = 8,
    targets: Annotated[
        str, typer.Option(metavar="LIST", help="Relative errors to report the time to.")
    ] = "0.1,0.03,0.01,0.003",
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="METHOD", help="Only this method: ours, mitsuba_llvm, ...; repeatable."
        ),
    ] = None,
    fresh: Fresh = False,
    workers: Annotated[
        int | None,
        typer.Option(
            min=1, help="Scenes at a time, each in a process: their times disturb each other."
        ),
    ] = None,
    scheduler: Scheduler = None,
    cluster: ClusterFile = None,
    define: Defaults = None,
    markdown: Annotated[Path | None, table_in("convergence")] = None,
    plots: Plots = None,
) -> None:
    """Measure error against run time of reference_rt and of Mitsuba.

    A rung is a number of samples per pixel.  Finished rungs are kept in the output folder.
    """
    with compare_extra():
        from comparisons.commands.outputs import Outputs
        from comparisons.experiments.convergence.findings import Curves
        from comparisons.experiments.convergence.methods import chosen
        from comparisons.experiments.convergence.outputs import (
            again,
            lines_of,
            write_results,
            write_table,
        )
        from comparisons.experiments.convergence.page import markdown as tables
        from comparisons.experiments.convergence.page import plots_of, write_page
        from comparisons.experiments.convergence.run import INVALID, curves_of
        from comparisons.experiments.convergence.store import Settings
        from comparisons.results.case import INTERRUPTED
        from comparisons.runs.elsewhere import run_elsewhere
        from comparisons.runs.provenance import provenance
        from comparisons.suites.suite import Changes, folder_name
    from reference_rt.cli.options import Where
    from reference_rt.util.console import ProgressLine
    from reference_rt.util.workers import Processes

    settings = Settings(
        time_limit=seconds_of(time_limit, "--time-limit"),
        size=None if size is None else size_of(size),
        max_spp=max_spp,
        replicates=replicates,
        targets=_targets(targets),
        only=tuple(only or ()),
    )
    chosen(settings.only)
    changes = Changes(defaults=by_name(define))
    names = [printable(path.stem) for path in scenes]
    if double := [name for name in names if names.count(name) > 1]:
        raise UsageError(f"two scenes have the name '{double[0]}'; expected different names")
    names_of_files = ("results.json", "results.csv", "report.html")
    writes = Outputs(out, names_of_files, ("rungs",), (markdown, "convergence"), plots)
    writes.check()
    facts = provenance()
    found = [Curves(name, problem=INTERRUPTED) for name in names]

    tasks = [
        (path.absolute(), changes, settings, (out / "rungs" / folder_name(name)).absolute(), fresh)
        for path, name in zip(scenes, names, strict=True)
    ]

    def measured(where: Where) -> Iterator[tuple[int, Curves]]:
        if where.is_elsewhere:
            with closing(where.open(Processes)) as opened:
                yield from enumerate(run_elsewhere(opened, curves_of, tasks))
            return
        for k, task in enumerate(tasks):
            with ProgressLine() as progress:

                def tell(what: str, part: float, k: int = k) -> None:
                    progress(what if what == "compile" else f"{names[k]}: {what}", part)

                yield k, curves_of(*task, tell)

    for k, curves in measured(Where(workers, scheduler, cluster)):
        found[k] = replace(curves, scene=names[k], again=again(scenes[k], out, settings))
        # After each scene, so that an interruption loses none that is finished.
        results, table, page = writes.files
        write_results(results, found, settings, facts)
        write_table(table, found)
        write_page(page, found, settings, facts)
        for line in lines_of(found[k]):
            say(line)
    writes.finish(lambda: tables(found, facts), lambda: plots_of(found), facts)
    if any(curves.problem.startswith(INVALID) for curves in found):
        raise typer.Exit(SceneError.exit_code)


def _targets(text: str) -> tuple[float, ...]:
    try:
        found = tuple(float(part) for part in text.split(","))
    except ValueError:
        found = ()
    if not found or not all(0.0 < target < 10.0 for target in found):
        raise UsageError(f"--targets: expected relative errors such as 0.1,0.01, got '{text}'")
    return found

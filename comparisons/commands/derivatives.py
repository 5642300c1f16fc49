"""`reference-rt derivatives`: which of Mitsuba's derivatives are right, by which parameter."""

from contextlib import closing
from pathlib import Path
from typing import Annotated, cast, get_args

import typer

from comparisons.commands.options import (
    Fresh,
    NumberOfWorkers,
    Scenes,
    Threads,
    compare_extra,
    out_folder,
    some_of,
    table_in,
)
from comparisons.results.differentiators import DifferentiatorName, Guiding
from reference_rt.cli.guarded import guarded, say


@guarded
def derivatives(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME]...",
            help="Only these cases, or patterns such as 'cornell_box.*'. (default: all)",
        ),
    ] = None,
    out: Annotated[Path, out_folder("results.json and report.html")] = Path("out/derivatives"),
    integrator: Annotated[
        list[str] | None,
        typer.Option(help="Mitsuba's; repeat it for several. (default: all four)"),
    ] = None,
    guiding: Annotated[
        list[str] | None,
        typer.Option(help="Of those that sample edges; repeat it for several. (default: none)"),
    ] = None,
    workers: NumberOfWorkers = 1,
    threads: Threads = None,
    fresh: Fresh = False,
    scenes: Scenes = Path("scenes"),
    markdown: Annotated[Path | None, table_in("derivatives")] = None,
) -> None:
    """Compare Mitsuba's derivatives by parameters of all kinds with differences of ours.

    Finished cases are kept in the output folder and not run again.  What Mitsuba leaves out by
    design, such as edges that move in prb, is `differ` here, with this cause.

    Exit code: 0 if each case was decided, 1 if one was not, 2 and above as of `compare`.
    """
    with compare_extra():
        from comparisons.commands.outputs import Outputs
        from comparisons.results.case import exit_code
        from comparisons.suites import derivatives as suite
        from comparisons.suites.run import Options, Run, run_cases, summarise
        from comparisons.translator.derivative import PROJECTIVE, Differentiator
    from reference_rt.util.workers import Threads as Pool

    by = some_of("--integrator", integrator, get_args(DifferentiatorName))
    ways = some_of("--guiding", guiding or ["none"], get_args(Guiding))
    chosen = [
        Differentiator(cast(DifferentiatorName, name), cast(Guiding | None, way))
        for name in by
        for way in (ways if name in PROJECTIVE else (None,))
    ]
    asked = suite.load()
    planned = suite.plan(asked, scenes, chosen, names or ())
    writes = Outputs(out, (), markdown=(markdown, suite.NAME))
    writes.check()

    def tell(run: Run) -> None:
        summarise(run.cases, run.walls, run.not_run, run.missing, every=True)
        say(f"{options.results}, {options.report}", err=True)

    with closing(Pool(workers or 1)) as pool:
        options = Options(out, workers=pool, threads=threads, fresh=fresh, tell=tell)
        facts = {"suite": f"{suite.NAME}: {asked.about}"}
        run = run_cases(planned, options, suite=suite.NAME, facts=facts)
    writes.finish(lambda: "\n".join(suite.table(run.cases).markdown()))
    undecided = [case for case in run.cases if case.verdict in ("inconclusive", "invalid")]
    raise typer.Exit(exit_code(undecided, run.missing) if undecided or run.missing else 0)

"""`reference-rt suite`."""

import os
import sys
from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from comparisons.commands.options import (
    ClusterFile,
    Fresh,
    GitHub,
    JUnit,
    Scenes,
    Scheduler,
    compare_extra,
)
from comparisons.results.rungs import COMPARED
from reference_rt.cli.adjusted import Defaults, by_name
from reference_rt.cli.guarded import guarded, say
from reference_rt.util.errors import UsageError

MOST_WORKERS = 4
"""Default limit of processes at a time: each takes up to 2 GB."""


@guarded
def suite(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="smoke, standard, full or a .yaml file.")
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder for results and the page. (default: out/NAME)"),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="GLOB", help="Only cases whose names match, such as 'material_*'."),
    ] = None,
    rung: Annotated[
        list[str] | None,
        typer.Option(
            "--rung", "--tier", metavar="RUNG", help=f"Only this rung: {', '.join(COMPARED)}."
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers",
            "--jobs",
            min=1,
            help=f"Processes at a time. (default: all cores, at most {MOST_WORKERS})",
        ),
    ] = None,
    scheduler: Scheduler = None,
    cluster: ClusterFile = None,
    fresh: Fresh = False,
    junit: JUnit = None,
    github: GitHub = False,
    scenes: Scenes = Path("scenes"),
    define: Defaults = None,
) -> None:
    """Compare all scenes of a folder with Mitsuba.

    Finished cases are kept in the output folder and not run again.
    """
    with compare_extra():
        from comparisons.report.ci import github as github_actions
        from comparisons.report.ci import junit as junit_xml
        from comparisons.results.verdict import exit_code
        from comparisons.suites.display import summarise
        from comparisons.suites.run import Options, Run, run_suite
        from comparisons.suites.suite import Changes, load_suite, plan
    from reference_rt.cli.render_options import Where
    from reference_rt.util.files import check_writable
    from reference_rt.util.workers import Threads

    rungs = tuple(rung or ())
    if unknown := [name for name in rungs if name not in COMPARED]:
        raise UsageError(f"--rung: expected one of {', '.join(COMPARED)}, got '{unknown[0]}'")
    source = load_suite(name)
    changes = Changes(defaults=by_name(define))
    planned = plan(source, scenes, tuple(only or ()), rungs, changes)
    folder = out or Path("out") / source.name
    where, cores = Where(workers, scheduler, cluster), os.cpu_count() or 1
    most = min(cores, MOST_WORKERS)
    # A cluster has as many cases at a time as threads.
    threads = 1 if where.is_cluster else max(cores // (workers or most), 1)
    files = {work.name: work.path.as_posix() for work in planned.work}
    on_github = github or github_actions.is_there()
    summary = github_actions.summary_path() if on_github else None
    check_writable(*(path for path in (junit, summary) if path is not None))

    def tell(run: Run) -> None:
        """Write all outputs, after an interruption too: a build server must not show those of an
        earlier run."""
        if junit is not None:
            junit_xml.write(junit, run.cases, source.name, run.walls, run.not_run, run.missing)
        if on_github:
            github_actions.annotate(run.cases, sys.stdout, files, run.missing)
        if summary is not None:
            title = source.name
            github_actions.summarise(run.cases, summary, title, run.not_run, run.missing)
        summarise(run.cases, run.walls, run.not_run, run.missing)
        say(f"{options.results}, {options.report}", err=True)

    with closing(where.open(Threads, most)) as opened:
        options = Options(folder, rungs, opened, threads, fresh, tell=tell)
        run = run_suite(source, planned, options)
    raise typer.Exit(exit_code(run.cases, run.missing))

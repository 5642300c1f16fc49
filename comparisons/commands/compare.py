"""`reference-rt compare`."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from comparisons.commands.options import (
    AllowMissing,
    Fixed,
    Fresh,
    Threads,
    TimeLimit,
    compare_extra,
    out_folder,
)
from reference_rt.cli.adjusted import Defaults, by_name
from reference_rt.cli.guarded import guarded
from reference_rt.util.errors import UsageError

if TYPE_CHECKING:
    from comparisons.suites.suite import Changes


@guarded
def compare(
    scenes: Annotated[
        list[Path],
        typer.Argument(metavar="SCENE...", help="Scene files: .yaml, .json, or Mitsuba's .xml."),
    ],
    out: Annotated[Path, out_folder("results.json and report.html")] = Path("out"),
    spp: Annotated[
        int | None,
        typer.Option(help="Samples per pixel of each replicate. (default: the scene's)"),
    ] = None,
    size: Annotated[
        str | None, typer.Option(help="WIDTHxHEIGHT in pixels. (default: the scene's)")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the first replicate.")] = None,
    replicates: Annotated[
        int | None,
        typer.Option(
            min=2,
            help="Independent pictures by each renderer (path tracing) at the first look. "
            "(default: 8; with --fixed 16)",
        ),
    ] = None,
    time_limit: TimeLimit = None,
    fixed: Fixed = False,
    threads: Threads = None,
    fresh: Fresh = False,
    define: Defaults = None,
    allow_missing: AllowMissing = False,
) -> None:
    """Render scenes with reference_rt and with Mitsuba, and report whether they agree.

    Noisy pictures are looked at, and doubled in number until they decide or --time-limit is
    reached: easy scenes are done sooner. The chance of a false alarm over all looks is that of one.
    The reference of an .xml scene is that file, loaded by Mitsuba.

    Finished cases are kept in the output folder and not run again.
    """
    with compare_extra():
        from comparisons.compare.budget import Budget
        from comparisons.compare.looks import FIRST, SECONDS
        from comparisons.results.verdict import exit_code
        from comparisons.suites.display import summarise
        from comparisons.suites.run import Options, Run, run_cases
        from comparisons.suites.suite import Changes, plan_of_files

    changes = Changes(
        spp=spp, size=size, seed=seed, defaults=by_name(define), allow_missing=allow_missing
    )
    if fixed and time_limit is not None:
        raise UsageError("got --fixed and --time-limit; expected one of them")
    budget = (
        Budget(replicates=replicates or Budget().replicates)
        if fixed
        else Budget(replicates=replicates or FIRST, seconds=time_limit or SECONDS)
    )
    plan = plan_of_files(scenes, changes, budget)
    given = {"replicates": replicates, "time-limit": time_limit, "fixed": fixed or None}
    work = tuple(w._replace(again=_command(w.path, changes, given)) for w in plan.work)

    def tell(run: Run) -> None:
        summarise(run.cases, run.walls, run.not_run, run.missing, every=True)
        typer.echo(f"{options.results}, {options.report}", err=True)

    options = Options(out, threads=threads, fresh=fresh, steps=True, tell=tell)
    run = run_cases(plan._replace(work=work), options)
    raise typer.Exit(exit_code(run.cases, run.missing))


def _command(path: Path, changes: "Changes", given: Mapping[str, float | bool | None]) -> str:
    """The command that repeats one case alone;  given: other options."""
    import shlex

    options = {**changes.model_dump(exclude={"defaults", "allow_missing"}), **given}
    options["allow-missing"] = changes.allow_missing or None
    words = [
        f"--{name}"
        if value is True
        else f"--{name} {value:g}"
        if isinstance(value, float)
        else f"--{name} {value}"
        for name, value in options.items()
        if value is not None
    ]
    words += [f"-D {shlex.quote(f'{k}={v}')}" for k, v in changes.defaults.items()]
    return " ".join(["reference-rt compare", shlex.quote(str(path)), "--fresh", *words])

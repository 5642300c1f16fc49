"""`reference-rt compare`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from comparisons.commands.extra import compare_extra
from comparisons.commands.options import Fresh, Threads, out_folder
from reference_rt.cli.defaults import Defaults, by_name
from reference_rt.cli.main import guarded

if TYPE_CHECKING:
    from comparisons.suites.work import Changes


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
        int, typer.Option(min=2, help="Independent pictures by each renderer (path tracing).")
    ] = 16,
    threads: Threads = None,
    fresh: Fresh = False,
    define: Defaults = None,
) -> None:
    """Render scenes with reference_rt and with Mitsuba, and report whether they agree.

    The reference of an .xml scene is that file, loaded by Mitsuba.

    Finished cases are kept in the output folder and not run again.
    """
    with compare_extra():
        from comparisons.compare.budget import Budget
        from comparisons.results.verdict import exit_code
        from comparisons.suites.display import summarise
        from comparisons.suites.run import Options, Run, run_cases
        from comparisons.suites.work import Changes, plan_of_files

    changes = Changes(spp=spp, size=size, seed=seed, defaults=by_name(define))
    plan = plan_of_files(scenes, changes, Budget(replicates=replicates))
    work = tuple(w._replace(again=_command(w.path, changes, replicates)) for w in plan.work)

    def tell(run: Run) -> None:
        summarise(run.cases, run.walls, run.not_run, run.missing)
        typer.echo(f"{options.results}, {options.report}", err=True)

    options = Options(out, threads=threads, fresh=fresh, steps=True, tell=tell)
    run = run_cases(plan._replace(work=work), options)
    raise typer.Exit(exit_code(run.cases, run.missing))


def _command(path: Path, changes: "Changes", replicates: int) -> str:
    """The command that repeats one case alone."""
    import shlex

    options = {**changes.model_dump(exclude={"defaults"}), "replicates": replicates}
    given = [f"--{name} {value}" for name, value in options.items() if value is not None]
    given += [f"-D {shlex.quote(f'{k}={v}')}" for k, v in changes.defaults.items()]
    return " ".join(["reference-rt compare", shlex.quote(str(path)), "--fresh", *given])

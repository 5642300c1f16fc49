"""`reference-rt stability`."""

import os
from contextlib import closing
from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

from comparisons.commands.options import (
    ClusterFile,
    Fresh,
    NumberOfWorkers,
    Scheduler,
    compare_extra,
    out_folder,
    table_in,
)
from reference_rt.cli.guarded import guarded, say
from reference_rt.util.errors import UsageError


@guarded
def stability(
    out: Annotated[Path, out_folder("results and the page", "DIR")] = Path("out/stability"),
    family: Annotated[
        list[str] | None, typer.Option(help="Only this family, F1 to F14: repeat for several.")
    ] = None,
    full: Annotated[
        bool, typer.Option("--full/--quick", help="All settings: about 20 minutes instead of 2.")
    ] = False,
    series: Annotated[
        str | None, typer.Option(metavar="NAME", help="Only this series; needs one --family.")
    ] = None,
    at: Annotated[
        float | None, typer.Option(metavar="X", help="Only this setting; needs --series.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all random scenes and rays.")] = 1,
    workers: NumberOfWorkers = None,
    scheduler: Scheduler = None,
    cluster: ClusterFile = None,
    mitsuba: Annotated[
        bool, typer.Option("--mitsuba/--no-mitsuba", help="Measure Mitsuba too.")
    ] = True,
    fresh: Fresh = False,
    markdown: Annotated[Path | None, table_in("stability")] = None,
) -> None:
    """Find where reference_rt and Mitsuba fail as scenes become extreme.

    Exact arithmetic and closed forms decide which answer is right.
    """
    with compare_extra():
        from comparisons.experiments.stability.harness import outputs
        from comparisons.experiments.stability.harness.core import MODULES, Effort, summaries
        from comparisons.experiments.stability.harness.core import family as family_of
        from comparisons.experiments.stability.harness.run import (
            Choice,
            mitsuba_is_there,
            run,
            shoot,
        )
        from comparisons.report import templates, terminal
        from comparisons.runs.provenance import ours, provenance

        import_module("matplotlib")  # before minutes of measuring that the page then cannot show
    from reference_rt.cli.render_options import Where
    from reference_rt.util.files import check_writable
    from reference_rt.util.workers import Threads

    names = tuple(dict.fromkeys(family or MODULES))
    if unknown := [name for name in names if name not in MODULES]:
        raise UsageError(f"--family: expected one of {', '.join(MODULES)}, got '{unknown[0]}'")
    if series is not None:
        if len(names) > 1:
            raise UsageError("--series: expected one --family with it")
        known = family_of(names[0]).by_name
        if series not in known:
            raise UsageError(f"--series: expected one of {', '.join(known)}, got '{series}'")
    if at is not None and series is None:
        raise UsageError("--at: expected a --series with it")
    page = out / "stability.html"
    kept = out / "settings" / "a setting", out / "pictures" / "a picture"
    check_writable(out / "results.json", out / "results.csv", page, *kept)
    if markdown is not None:
        templates.check(markdown, "stability")
    missing = mitsuba_is_there() if mitsuba else "not asked"
    effort: Effort = "full" if full else "quick"
    choice = Choice(names, effort, seed, series, at, not missing)
    facts = provenance() if not missing else ours() | {"mitsuba": f"takes no part: {missing}"}
    where = Where(workers, scheduler, cluster)
    with (
        closing(where.open(Threads, os.cpu_count() or 1)) as opened,
        outputs.Display(len(choice.settings())) as display,
    ):
        display.line(f"seed {seed}; Mitsuba {facts['mitsuba']}")
        found = run(choice, out, opened, display.done, fresh)
        outputs.write_results(out, found, effort, seed, facts)
        display.line("pictures and page")
        pictures = shoot(choice, found, out, opened)
        outputs.write_page(page, found, pictures, effort, seed, facts)
    console = terminal.console()
    console.print(outputs.terminal(found, console.width))
    if markdown is not None:
        templates.rewrite(markdown, "stability", outputs.markdown(found, effort, seed, facts))
    holds = True
    for one in (s for some in summaries(found).values() for s in some):
        holds &= one.holds
        for f in one.found:
            if f.broken or f.x in one.failed:
                say(f"again: {outputs.again(f, effort, seed)}", err=True)
                for example in f.ours.examples if f.ours else ():
                    say(f"  {dict(example)}", err=True)
    say(f"{out / 'results.json'}, results.csv, stability.html", err=True)
    raise typer.Exit(0 if holds else 1)

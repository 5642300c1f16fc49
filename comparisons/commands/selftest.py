"""`reference-rt selftest`."""

import os
from collections.abc import Callable
from contextlib import closing
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated

import typer

from comparisons.commands.options import ClusterFile, NumberOfWorkers, Scenes, Scheduler, out_folder
from reference_rt.cli.guarded import guarded
from reference_rt.util.errors import UsageError
from reference_rt.util.workers import Workers


@guarded
def selftest(
    out: Annotated[Path, out_folder("selftest.json and selftest.md")] = Path("out"),
    only: Annotated[
        list[str] | None, typer.Option(help="Only faults whose names match this pattern.")
    ] = None,
    seeds: Annotated[int, typer.Option(min=0, help="Runs of each kind of right renderer.")] = 1000,
    power: Annotated[
        bool, typer.Option(help="Measure how often biases of each size are caught.")
    ] = True,
    mutants: Annotated[
        int,
        typer.Option(min=0, help="In place of all that: so many random changes of the kernels."),
    ] = 0,
    seed: Annotated[int, typer.Option(min=0, help="Of the random changes.")] = 0,
    scenes: Scenes = Path("scenes"),
    workers: NumberOfWorkers = None,
    scheduler: Scheduler = None,
    cluster: ClusterFile = None,
) -> None:
    """Test the harness: plant faults and check that the suites catch them; count false alarms."""
    from reference_rt.cli.render_options import Where
    from reference_rt.util.workers import Processes

    where = Where(workers, scheduler, cluster)

    def opened() -> Workers:
        return where.open(Processes, os.cpu_count() or 1)

    if mutants:
        _mutate(mutants, seed, scenes, out, opened)
        return
    from rich.console import Console

    from comparisons.experiments.selftest import FAULTS
    from comparisons.experiments.selftest.run import SUITES, run
    from reference_rt.util.files import check_writable

    patterns = only or ["*"]
    faults = [f for f in FAULTS if any(fnmatchcase(f.name, pattern) for pattern in patterns)]
    if not faults:
        raise UsageError(f"--only: no fault matches {', '.join(patterns)}")
    files = out / "selftest.json", out / "selftest.md"
    check_writable(*files)
    console = Console(stderr=True, highlight=False)

    def say(line: str) -> None:
        console.print(line, markup=False, soft_wrap=True)

    with closing(opened()) as some:
        outcome = run(faults, scenes, seeds, out, say, power, some)
    for suite in SUITES:
        caught, total = outcome.share(suite)
        say(f"{suite}: {caught} of {total} faults caught")
    for alarms in outcome.alarms:
        if not alarms.holds:
            say(f"{alarms.kind}, {alarms.name}: {alarms.false_alarms} false alarms")
    say(", ".join(map(str, files)))
    raise typer.Exit(0 if outcome.holds else 1)


def _mutate(count: int, seed: int, scenes: Path, out: Path, opened: Callable[[], Workers]) -> None:
    """Mutation testing; writes what is known after each mutant."""
    from rich.console import Console

    from comparisons.experiments.selftest.mutation import FILES, mutation, summary, write
    from comparisons.experiments.selftest.run import SUITES, budgets_of
    from reference_rt.util.files import check_writable

    check_writable(*(out / name for name in FILES))
    console = Console(stderr=True, highlight=False)

    def say(line: str) -> None:
        console.print(line, markup=False, soft_wrap=True)

    by_suite = budgets_of(scenes)
    budgets = {suite: by_suite[suite] for suite in reversed(SUITES)}  # the small one first
    fates = []
    with closing(opened()) as workers:
        for fate in mutation(count, seed, scenes, budgets, say, workers):
            fates.append(fate)
            where = f" ({fate.by}, {fate.rung}, {fate.scene})" if fate.rung else ""
            say(f"{fate.file}:{fate.line} {fate.what}: {fate.outcome}{where}")
            write(fates, seed, out)
    say(summary(fates))

"""Commands that look for faults of the harness and of both renderers: `reference-rt selftest`,
`stability` and `fuzz`.
"""

import os
from collections.abc import Callable
from contextlib import closing
from fnmatch import fnmatchcase
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from comparisons.commands.options import (
    ClusterFile,
    Fresh,
    JUnit,
    NumberOfWorkers,
    Plots,
    Scenes,
    Scheduler,
    Witness,
    compare_extra,
    out_folder,
    some_of,
    table_in,
)
from reference_rt.cli.guarded import guarded, say
from reference_rt.cli.options import duration
from reference_rt.util.errors import UsageError
from reference_rt.util.workers import Workers

if TYPE_CHECKING:
    from comparisons.renderers import Witnesses


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
    mirrored: Annotated[
        bool,
        typer.Option(
            "--mirrored",
            help="In place of all that: mistakes that are also in our code on Mitsuba's side.",
        ),
    ] = False,
    witness: Witness = None,
    scenes: Scenes = Path("scenes"),
    workers: NumberOfWorkers = None,
    scheduler: Scheduler = None,
    cluster: ClusterFile = None,
) -> None:
    """Test the harness: plant faults and check that the suites catch them; count false alarms."""
    from reference_rt.cli.options import Where
    from reference_rt.util.workers import Processes

    where = Where(workers, scheduler, cluster)

    def opened() -> Workers:
        return where.open(Processes, os.cpu_count() or 1)

    if mutants:
        _mutate(mutants, seed, scenes, out, opened)
        return
    patterns = only or ["*"]
    if mirrored:
        _mirror(patterns, scenes / "truth", witness, out, opened)
        return
    if witness:
        raise UsageError("--witness: expected --mirrored with it")
    from comparisons.commands.outputs import Outputs
    from comparisons.experiments.selftest import FAULTS
    from comparisons.experiments.selftest.run import SUITES, run

    faults = [f for f in FAULTS if any(fnmatchcase(f.name, pattern) for pattern in patterns)]
    if not faults:
        raise UsageError(f"--only: no fault matches {', '.join(patterns)}")
    writes = Outputs(out, ("selftest.json", "selftest.md"))
    writes.check()
    tell = partial(say, err=True)
    with closing(opened()) as some:
        outcome = run(faults, scenes, seeds, out, tell, power, some)
    for suite in SUITES:
        caught, total = outcome.share(suite)
        tell(f"{suite}: {caught} of {total} faults caught")
    for alarms in outcome.alarms:
        if not alarms.holds:
            tell(f"{alarms.kind}, {alarms.name}: {alarms.false_alarms} false alarms")
    writes.finish()
    raise typer.Exit(0 if outcome.holds else 1)


def _mutate(count: int, seed: int, scenes: Path, out: Path, opened: Callable[[], Workers]) -> None:
    """Mutation testing; writes what is known after each mutant."""
    from comparisons.commands.outputs import Outputs
    from comparisons.experiments.selftest.mutation import FILES, mutation, summary, write
    from comparisons.experiments.selftest.run import SUITES, budgets_of

    writes = Outputs(out, FILES)
    writes.check()
    tell = partial(say, err=True)
    by_suite = budgets_of(scenes)
    budgets = {suite: by_suite[suite] for suite in reversed(SUITES)}  # the small one first
    fates = []
    with closing(opened()) as workers:
        for fate in mutation(count, seed, scenes, budgets, tell, workers):
            fates.append(fate)
            where = f" ({fate.by}, {fate.rung}, {fate.scene})" if fate.rung else ""
            tell(f"{fate.file}:{fate.line} {fate.what}: {fate.outcome}{where}")
            write(fates, seed, out)
    for line in summary(fates).splitlines():
        tell(line)
    writes.finish()


def _mirror(
    patterns: list[str],
    scenes: Path,
    witness: "Witnesses",
    out: Path,
    opened: Callable[[], Workers],
) -> None:
    """Mistakes on both sides; writes what is known after each."""
    from comparisons.commands.outputs import Outputs
    from comparisons.experiments.selftest.mirrored import FILES, mirrored, summary, write
    from comparisons.experiments.selftest.of_mirrored import MISTAKES
    from comparisons.renderers import witness_facts

    some = [m for m in MISTAKES if any(fnmatchcase(m.name, pattern) for pattern in patterns)]
    if not some:
        raise UsageError(f"--only: no mistake matches {', '.join(patterns)}")
    witness_facts(witness)  # that it is there
    writes = Outputs(out, FILES)
    writes.check()
    tell = partial(say, err=True)
    found = []
    with closing(opened()) as workers:
        for one in mirrored(some, scenes, witness, workers):
            found.append(one)
            by = ", ".join([*one.by, *([f"truth {one.case}"] if one.truth == "off" else [])])
            tell(f"{one.mistake}: {one.alike} between both sides; seen by {by or 'nobody'}")
            write(found, out)
    tell(summary(found))
    writes.finish()
    raise typer.Exit(0 if all(one.holds for one in found) else 1)


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
    plots: Plots = None,
) -> None:
    """Find where reference_rt and Mitsuba fail as scenes become extreme.

    Exact arithmetic and closed forms decide which answer is right.
    """
    with compare_extra():
        from comparisons.commands.outputs import Outputs
        from comparisons.experiments.stability.harness import outputs, page
        from comparisons.experiments.stability.harness.points import summaries
        from comparisons.experiments.stability.harness.run import (
            Choice,
            mitsuba_is_there,
            run,
            shoot,
        )
        from comparisons.experiments.stability.harness.series import MODULES, Effort
        from comparisons.experiments.stability.harness.series import family as family_of
        from comparisons.report import terminal
        from comparisons.runs.provenance import ours, provenance

        import_module("matplotlib")  # before minutes of measuring that the page then cannot show
    from reference_rt.cli.options import Where
    from reference_rt.util.workers import Threads

    names = some_of("--family", family, MODULES)
    if series is not None:
        if len(names) > 1:
            raise UsageError("--series: expected one --family with it")
        some_of("--series", [series], family_of(names[0]).by_name)
    if at is not None and series is None:
        raise UsageError("--at: expected a --series with it")
    files, kept = ("results.json", "results.csv", "stability.html"), ("settings", "pictures")
    writes = Outputs(out, files, kept, (markdown, "stability"), plots)
    writes.check()
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
        page.write_page(writes.files[-1], found, pictures, effort, seed, facts)
    console = terminal.console()
    console.print(outputs.terminal(found, console.width))
    holds = True
    for one in (s for some in summaries(found).values() for s in some):
        holds &= one.holds
        for f in one.found:
            if f.broken or f.x in one.failed:
                say(f"again: {outputs.again(f, effort, seed)}", err=True)
                for example in f.ours.examples if f.ours else ():
                    say(f"  {dict(example)}", err=True)
    table = partial(outputs.markdown, found, effort, seed, facts)
    writes.finish(table, lambda: page.failures(found), facts)
    raise typer.Exit(0 if holds else 1)


@guarded
def fuzz(
    count: Annotated[
        int | None, typer.Option(min=1, help="Scenes to check. (default: 100, or until --time)")
    ] = None,
    time: Annotated[str | None, duration("Begin scenes for so long")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all scenes.")] = 0,
    first: Annotated[int, typer.Option(min=0, help="Number of the first scene.")] = 0,
    rungs: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="Only these, comma-separated: render, identities, files, film, geometry, direct, "
            "whitted, layers, statistics.  `files` alone: random files of every format.",
        ),
    ] = None,
    features: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="Types or groups of types that every scene has, comma-separated: csg,glass,torus.",
        ),
    ] = None,
    extreme: Annotated[
        bool, typer.Option("--extreme", help="Also scenes that are far, tiny or thin.")
    ] = False,
    scene: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="Check this scene instead: repeat for several."),
    ] = None,
    rays: Annotated[
        int | None, typer.Option(min=16, help="Camera rays of each scene. (default: 48)")
    ] = None,
    renderer: Annotated[
        str | None,
        typer.Option(
            metavar="COMMAND",
            help="Compare this renderer with ours, in place of Mitsuba: "
            '"prog {scene} -o {output} --seed {seed} --spp {spp}", as in `gate`.',
        ),
    ] = None,
    variant: Annotated[
        Literal["scalar_rgb", "llvm_ad_rgb"],
        typer.Option(help="Of Mitsuba: `compare` takes llvm_ad_rgb, five times as long a scene."),
    ] = "scalar_rgb",
    stop: Annotated[bool, typer.Option("--stop", help="Stop at the first finding.")] = False,
    reduce: Annotated[str, duration("Time to reduce a finding, or 0 for not at all")] = "2m",
    workers: NumberOfWorkers = None,
    scheduler: Scheduler = None,
    cluster: ClusterFile = None,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Remove stored results first, and check all again.")
    ] = False,
    out: Annotated[Path, out_folder("results and the page", "DIR")] = Path("out/fuzz"),
    junit: JUnit = None,
    planted: Annotated[
        str | None,
        typer.Option(
            metavar="PATTERN",
            help="In place of all that: plant the source faults of `selftest` whose names match, "
            "and measure how soon each is found.",
        ),
    ] = None,
) -> None:
    """Search for scenes that the two renderers, or two descriptions of one scene, disagree on.

    Random valid scenes are rendered, changed in ways that must not matter, and compared with
    Mitsuba; a scene that fails is reduced to a few lines. A run with the same options and folder
    goes on where the last one ended.

    Exit codes: 0: nothing was found; 1: findings; 2: wrong usage; 4: Mitsuba is missing.
    """
    with compare_extra("fuzzing"):
        from comparisons.commands.outputs import Outputs
        from comparisons.experiments.fuzz import summary
        from comparisons.experiments.fuzz.finding import RUNGS, Effort, Grammar
        from comparisons.experiments.fuzz.results import remove
        from comparisons.experiments.fuzz.run import Plan, run
        from comparisons.experiments.fuzz.schema import features as known
        from comparisons.experiments.fuzz.summary import Display, write_page
        from comparisons.mitsuba.backend import asked_for
        from comparisons.runs.provenance import provenance
    from reference_rt.cli.options import Where
    from reference_rt.cli.quantities import seconds_of
    from reference_rt.util.workers import Threads

    where = Where(workers, scheduler, cluster)
    if planted is not None:
        if where.is_cluster:
            raise UsageError("--planted: changes the renderer's sources here; expected --workers")
        _plant(planted, out, seed, workers or os.cpu_count() or 1)
        return
    effort: dict[str, Any] = {"variant": variant}
    effort |= {} if rays is None else {"pixels": rays, "light_pixels": rays}
    if rungs is not None:
        effort["rungs"] = some_of("--rungs", rungs.split(","), RUNGS)
    names = () if features is None else tuple(features.split(","))
    known(names)
    seconds = None if time is None else seconds_of(time, "--time")
    writes = Outputs(out, ("fuzz.json", "fuzz.html"), others=(junit,))
    writes.check()
    if fresh:
        remove(out)
    scenes = tuple(_data(path, out) for path in scene or ())
    with closing(where.open(Threads, os.cpu_count() or 1)) as opened:
        plan = Plan(
            out=out,
            seed=seed,
            count=count if count is not None or time is not None else 100,
            seconds=seconds,
            first=first,
            workers=opened,
            grammar=Grammar(names, extreme),
            effort=Effort(**effort),
            stop=stop,
            command=renderer or "",
            scenes=scenes,
            shrink=0.0 if reduce == "0" else seconds_of(reduce, "--reduce"),
        )
        with Display(len(plan.scenes) or plan.count) as display:
            found = run(plan, display.done, display.line)
    with asked_for(variant):
        facts = provenance()
    summary.write_results(plan, found, facts, junit)
    write_page(writes.files[-1], plan, found, facts)
    for line in summary.words(found):
        say(line)
    for one, times in summary.distinct(found):
        say(f"{one.finding.rung}: {one.finding.cause} ({times} scenes, such as {one.number})")
        say(f"  {one.finding.detail.splitlines()[0][:300]}")
        say(f"  {summary.again(plan, one)}")
    writes.finish()
    raise typer.Exit(1 if found.findings else 0)


def _plant(pattern: str, out: Path, seed: int, workers: int) -> None:
    """Search for planted faults, and say what became of each."""
    from comparisons.commands.outputs import Outputs
    from comparisons.experiments.fuzz.planted import FILE, search, source_faults, summary

    faults = [fault for fault in source_faults() if fnmatchcase(fault.name, pattern)]
    if not faults:
        raise UsageError(f"--planted: no source fault matches {pattern}")
    Outputs(out, (FILE,)).check()
    found = []
    for one in search(faults, out, seed, workers):
        found.append(one)
        after = f"after {one.scenes} scenes: {one.rung}: {one.cause}" if one.scenes else "not found"
        say(f"{one.fault}: {after}; {one.shapes} shapes, {one.lines} lines")
    say(summary(found))
    raise typer.Exit(0 if all(one.scenes for one in found) else 1)


def _data(path: Path, out: Path) -> dict[str, Any]:
    """The data of a scene file; the files that it names must lie in the run's folder of files, or
    beside it, from where they are copied."""
    import json

    from comparisons.experiments.fuzz.assets import bring
    from reference_rt.rendering.scene import Scene

    scene = Scene.load(path)
    data: dict[str, Any] = json.loads(scene.to_json())
    bring(data, scene.folder, out / "files")
    return data

"""`reference-rt derivatives`: which of Mitsuba's derivatives are right, by which parameter; and
`gate --derivative`."""

import shlex
import sys
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Annotated, cast, get_args

import typer

from comparisons.commands.options import (
    Fresh,
    NumberOfWorkers,
    Scenes,
    Threads,
    TimeLimit,
    compare_extra,
    out_folder,
    some_of,
    table_in,
)
from comparisons.results.differentiators import DifferentiatorName, Guiding
from reference_rt.cli.guarded import guarded, say
from reference_rt.cli.quantities import seconds_of
from reference_rt.util.errors import UsageError, printable


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
    time_limit: TimeLimit = None,
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
    if time_limit is not None:
        limit = seconds_of(time_limit, "--time-limit")
        asked = asked.model_copy(update={"seconds": limit})
    planned = suite.plan(asked, scenes, chosen, names or ())
    written = ("results.json", "report.html")
    writes = Outputs(out, written, ("cases",), markdown=(markdown, suite.NAME))
    writes.check()

    def tell(run: Run) -> None:
        summarise(run.cases, run.walls, run.not_run, run.missing, every=True)

    with closing(Pool(workers or 1)) as pool:
        options = Options(out, workers=pool, threads=threads, fresh=fresh, tell=tell)
        facts = {"suite": f"{suite.NAME}: {asked.about}"}
        run = run_cases(planned, options, asked.case_seconds, suite.NAME, facts)
    writes.finish(lambda: "\n".join(suite.table(planned, run.cases).markdown()))
    undecided = [case for case in run.cases if case.verdict in ("inconclusive", "invalid")]
    raise typer.Exit(exit_code(undecided, run.missing) if undecided or run.missing else 0)


def derivative_gate(
    candidates: Sequence[Path],
    parameter: str,
    scene: Path | None,
    reference: Sequence[Path],
    layer: str,
    out: Path,
    *,
    spp: int | None,
    size: str | None,
    limit: float,
    step: float | None,
    threads: int | None,
) -> None:
    """`gate --derivative PARAMETER`: derivative pictures against differences of ours, or against
    one picture that is exact."""
    with compare_extra("the gate"):
        from comparisons.commands.outputs import Outputs
        from comparisons.gate import outputs
        from comparisons.gate.derivative import Asked, case_of
        from comparisons.gate.pictures_in import read_candidate, read_candidates
        from comparisons.results.headline import headline
    from reference_rt.cli.options import adjusted
    from reference_rt.rendering.scene import Scene

    if not candidates:
        raise UsageError("--derivative: expected candidates, two or more")
    if len(reference) > 1 or (scene is None) == (not reference):
        raise UsageError("--derivative: expected --scene, or one --reference, which is exact")
    Outputs(out, ("results.json", "report.html")).prepare()
    pictures = [p.radiance for path in candidates for p in read_candidates(path, layer)]
    described = None if scene is None else adjusted(Scene.load(scene), spp, size)
    asked = Asked(
        scene=described,
        parameter=parameter if scene else "",
        closed=read_candidate(reference[0]).radiance if reference else None,
        step=step,
        limit=limit,
        threads=threads,
        name=printable(scene.stem if scene else reference[0].stem),
    )
    case = case_of(pictures, asked)
    case = replace(case, again=shlex.join(["reference-rt", *sys.argv[1:]]))
    facts = {"limit": limit, "candidates": [str(path) for path in candidates]}
    results, report = outputs.write(case, out, facts)
    say(f"{case.scene}: {case.verdict}: {headline(case)}")
    if case.cause is not None:
        say(f"  {case.cause.name}: {case.cause.evidence}")
    say(f"{results}, {report}", err=True)
    raise typer.Exit(outputs.code_of(case))

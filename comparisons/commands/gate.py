"""`reference-rt gate`."""

import shlex
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from comparisons.commands.extra import compare_extra
from comparisons.commands.options import Baselines, GitHub, JUnit, Layer, NoiseFree, Threads
from reference_rt.cli.main import guarded, say
from reference_rt.rendering.scene import Scene
from reference_rt.util.console import ProgressLine
from reference_rt.util.errors import ReferenceRtError, UsageError, printable

if TYPE_CHECKING:
    from comparisons.gate.pictures_in import Picture


@guarded
def gate(
    candidates: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[CANDIDATE]...",
            help="Pictures to judge (EXR, PNG, PFM, HDR, NPY); several are replicates.",
        ),
    ] = None,
    scene: Annotated[
        Path | None,
        typer.Option(help="The scene shown; reference_rt renders it as the reference."),
    ] = None,
    reference: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE", help="Compare with this picture instead; several are replicates."
        ),
    ] = None,
    variance: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Variance per pixel of one --reference.")
    ] = None,
    baseline: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Compare with a baseline written by `accept` instead."),
    ] = None,
    baselines: Baselines = Path("baselines"),
    command: Annotated[
        str | None,
        typer.Option(
            help="Run this renderer to make the candidates: "
            '"prog {scene} -o {output} --seed {seed} --spp {spp}".'
        ),
    ] = None,
    replicates: Annotated[
        int | None, typer.Option(min=1, help="Runs of --command. (default: 8; 1 without noise)")
    ] = None,
    spp: Annotated[
        int | None, typer.Option(min=1, help="Value of {spp}. (default: the scene's)")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="First value of {seed}. (default: 1)")
    ] = None,
    time_limit: Annotated[
        float | None,
        typer.Option(min=0.1, metavar="SECONDS", help="Limit of one run. (default: 600)"),
    ] = None,
    suffix: Annotated[
        str | None, typer.Option(help="Suffix of {output}. (default: .exr)", metavar=".EXT")
    ] = None,
    layer: Layer = "",
    limit: Annotated[
        float,
        typer.Option(help="Smallest relative bias of the image mean that must be detectable."),
    ] = 0.005,
    noise_free: NoiseFree = False,
    rim: Annotated[
        int,
        typer.Option(
            min=0,
            metavar="PIXELS",
            help="Leave out the outermost pixels, which a wide filter makes differ by convention.",
        ),
    ] = 0,
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Folder for results.json and report.html.")
    ] = Path("out"),
    junit: JUnit = None,
    github: GitHub = False,
    threads: Threads = None,
) -> None:
    """Compare another renderer's pictures with our rendering, a reference or a baseline.

    Exit codes: 0: they agree; 1: they differ, or are too noisy to tell; 2: wrong usage; 3: invalid
    picture, scene or baseline; 4: the renderer could not run, or the baseline is missing or stale.
    """
    with compare_extra("the gate"):
        from comparisons.gate import outputs
        from comparisons.gate.driver import Command, drive
        from comparisons.gate.gate import not_run
        from comparisons.gate.pictures_in import read_candidates
        from comparisons.gate.reference import is_noise_free
        from comparisons.gate.request import Request, gated

    if (command is None) == (not candidates):
        raise UsageError("expected either candidates or --command")
    driving: dict[str, Any] = {"replicates": replicates, "spp": spp, "seed": seed, "suffix": suffix}
    driving |= {"time-limit": time_limit}
    given = [name for name, value in driving.items() if value is not None]
    if command is None and given:
        raise UsageError(f"--{given[0]}: only applies to --command; expected that too")
    described = None if scene is None else Scene.load(scene)
    run = None
    if command is not None:
        noiseless = noise_free or (described is not None and is_noise_free(described))
        own = None if described is None else getattr(described.resolved_sampler, "spp", None)
        run = Command(command, scene, spp or own, suffix or ".exr", time_limit or 600.0)
        run.arguments(out, 0)
        first = 1 if seed is None else seed
        seeds = range(first, first + (replicates or (1 if noiseless else 8)))

    def tell(line: str) -> None:
        say(line, err=True)

    name = baseline or ("" if described is None else described.name)
    name = printable(name or Path((reference or [Path("nothing")])[0]).stem)
    kept = () if run is None else (out / "candidates" / "a candidate",)
    outputs.prepare(out, *kept, *outputs.ci_files(junit, github))
    start = time.perf_counter()
    pictures: list[Picture] = []
    failed: ReferenceRtError | None = None
    try:
        request = Request(
            scene=described,
            references=tuple(p for path in reference or () for p in read_candidates(path, layer)),
            variance=variance,
            baseline=baseline or "",
            baselines=baselines,
            limit=limit,
            noise_free=noise_free,
            threads=threads,
            rim=rim,
            name=name,
        )
        if run is not None:
            pictures = drive(run, seeds, out / "candidates", tell)
        else:
            pictures = [p for path in candidates or () for p in read_candidates(path, layer)]
        driven = time.perf_counter() - start
        with ProgressLine() as progress:
            case = gated(request, pictures, progress)
    except UsageError:
        raise
    except ReferenceRtError as error:
        case, failed = not_run(name, error), error
    else:
        case = replace(case, seconds={"candidate": {"render": driven}} if run else {})
    case = replace(case, again=shlex.join(["reference-rt", *sys.argv[1:]]))
    names = [str(path) for path in candidates or ()]
    facts = {"limit": limit, "candidates": names or [picture.name for picture in pictures]}
    facts |= {"baseline": baseline} if baseline else {}
    facts |= {"command": command} if command else {}
    results, report = outputs.write(case, out, facts)
    outputs.for_ci(case, junit, "" if scene is None else scene.as_posix(), github)
    if failed is not None:
        raise failed
    say(f"{case.scene}: {case.verdict}: {case.reason}")
    if case.cause is not None:
        say(f"{case.scene}: likeliest cause: {case.cause.name}: {case.cause.evidence}")
    tell(f"{results}, {report}")
    raise typer.Exit(outputs.code_of(case))

"""`reference-rt gate`: the pictures of another renderer."""

import shlex
import signal
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from comparisons.commands.derivatives import derivative_gate
from comparisons.commands.options import (
    Baselines,
    Fixed,
    GitHub,
    JUnit,
    Layer,
    Limit,
    NoiseFree,
    Threads,
    Witness,
    compare_extra,
)
from comparisons.commands.pair import pair_gate
from comparisons.commands.truth import truth_gate
from comparisons.results import LIMIT
from reference_rt.cli.guarded import guarded, say
from reference_rt.cli.options import AllowMissing, Defaults, adjusted, by_name, duration
from reference_rt.cli.quantities import seconds_of
from reference_rt.cli.watching import stamps, wait_for_change
from reference_rt.util.errors import ReferenceRtError, UsageError, printable

if TYPE_CHECKING:
    from comparisons.gate.pictures_in import Picture
    from comparisons.results.case import Case


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
    truth: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Compare with the formula of this case of `truth` instead; with --command also an "
            "area, a pattern, or all.",
        ),
    ] = None,
    command: Annotated[
        str | None,
        typer.Option(
            help="Run this renderer to make the candidates: "
            '"prog {scene} -o {output} --seed {seed} --spp {spp}"; also {width}, {height}, and '
            "{seeds}, with which one start makes several pictures: %d in {output} is the seed."
        ),
    ] = None,
    browser: Annotated[
        str | None,
        typer.Option(
            metavar="PAGE[?QUERY]",
            help="Let this web page make the candidates, in Chromium: its window.render() gets the "
            "scene as data and returns pixels, see docs/realtime.md.",
        ),
    ] = None,
    replicates: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Pictures by --command or --browser at the first look; 1: no more. "
            "(default: 8; 1 without noise or by --browser)",
        ),
    ] = None,
    fixed: Fixed = False,
    spp: Annotated[
        int | None,
        typer.Option(min=1, help="Samples per pixel of the scene, and {spp}. (default: its own)"),
    ] = None,
    size: Annotated[
        str | None,
        typer.Option(
            metavar="WIDTHxHEIGHT",
            help="The scene's size, and {width} and {height}. (default: its own)",
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="First value of {seed}; the others are far from it. (default: 1)"),
    ] = None,
    time_limit: Annotated[
        str | None,
        duration(
            "Add no pictures by --command or --browser beyond this time; also the limit of each",
            "10m",
        ),
    ] = None,
    suffix: Annotated[
        str | None,
        typer.Option(
            help="Suffix of {output}. (default: .exr) Of --browser: .png if the page returns 8-bit "
            "codes. (default: .npy)",
            metavar=".EXT",
        ),
    ] = None,
    layer: Layer = "",
    reference_layer: Annotated[
        str | None, typer.Option(help="The same of --reference. (default: that of --layer)")
    ] = None,
    limit: Limit = LIMIT,
    noise_free: NoiseFree = False,
    tolerance: Annotated[
        float,
        typer.Option(
            help="Permitted relative error of a value in a picture of --scene without noise."
        ),
    ] = 0.001,
    tone_curve: Annotated[
        str,
        typer.Option(
            metavar="CURVE[:EXPOSURE]",
            help="What pictures without noise went through before sRGB: linear, reinhard, cineon, "
            "aces, agx, neutral, filmic, exponential, a file of pairs, or estimate.",
        ),
    ] = "",
    renderer: Annotated[
        str,
        typer.Option(
            "--from",
            metavar="NAME[:numbers]",
            help="Read the candidates as this renderer means them, its conventions undone: "
            "babylon, cycles, luxcore, mitsuba, povray, radiance, raysect, tachyon or three; with "
            ":numbers also what its numbers of lights mean.",
        ),
    ] = "",
    witness: Witness = None,
    beside: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=FILE",
            help="Show this picture, another renderer's, on the page too; it is not judged.",
        ),
    ] = None,
    pair: Annotated[
        tuple[str, str] | None,
        typer.Option(
            metavar="A B",
            help="Whether two renderers, back ends or versions make the same pictures: two "
            "commands as of --command, web pages, or folders of pictures.",
        ),
    ] = None,
    judge: Annotated[
        bool, typer.Option("--judge", help="With --pair: our pictures of --scene say who is wrong.")
    ] = False,
    derivative: Annotated[
        str | None,
        typer.Option(
            metavar="PARAMETER",
            help="The candidates are derivatives by this parameter of --scene, such as "
            "materials.red.reflectance; or, in any word, of one --reference, which is exact.",
        ),
    ] = None,
    step: Annotated[
        float | None,
        typer.Option(help="Of our differences, in its unit. (default: 1/256 of it)"),
    ] = None,
    rim: Annotated[
        int,
        typer.Option(
            min=0,
            metavar="PIXELS",
            help="Leave out the outermost pixels, which a wide filter makes differ by convention.",
        ),
    ] = 0,
    watch: Annotated[
        bool,
        typer.Option(
            "--watch",
            help="Judge again whenever a candidate or a --reference is written; Ctrl-C ends, with "
            "the last verdict's exit code.",
        ),
    ] = False,
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Folder for results.json and report.html.")
    ] = Path("out"),
    junit: JUnit = None,
    github: GitHub = False,
    threads: Threads = None,
    define: Defaults = None,
    allow_missing: AllowMissing = False,
) -> None:
    """Compare another renderer's pictures with our rendering, a reference or a baseline.

    The pictures that --command makes are doubled in number until they decide or --time-limit is
    reached. The chance of a false alarm over all looks is that of one.

    Exit codes: 0: they agree, or are unchanged; 1: they differ, or are too noisy to tell; 2: wrong
    usage; 3: invalid picture, scene or baseline; 4: the renderer could not run, or the baseline is
    missing or stale.
    """
    with compare_extra("the gate"):
        from comparisons.commands.outputs import Outputs
        from comparisons.compare.looks import SECONDS
        from comparisons.gate import outputs
        from comparisons.gate.driver import Command, Driver
        from comparisons.gate.gate import not_run
        from comparisons.gate.pictures_in import read_candidates
        from comparisons.gate.reference import SizeError, is_noise_free
        from comparisons.gate.request import Request, gated
        from comparisons.gate.rounds import Rounds, gated_renderer
        from comparisons.gate.undone import Reading
        from comparisons.renderers import witness_facts
        from comparisons.report import biases, terminal
        from comparisons.report.ci import Formats
        from comparisons.results.case import trace_command
        from comparisons.results.headline import headline
        from comparisons.translator.resolved import write_resolved
    from reference_rt.rendering.scene import Scene
    from reference_rt.util.console import ProgressLine

    seconds = None if time_limit is None else seconds_of(time_limit, "--time-limit")
    if pair is not None:
        alone: dict[str, Any] = {"reference": reference, "variance": variance, "truth": truth}
        alone |= {"baseline": baseline, "command": command, "browser": browser, "step": step}
        alone |= {"witness": witness, "derivative": derivative, "tone-curve": tone_curve}
        alone |= {"from": renderer, "watch": watch, "beside": beside}
        alone = {f"--{name}": value for name, value in alone.items()} | {"candidates": candidates}
        for name, value in {**alone, "--reference-layer": reference_layer}.items():
            if value:
                raise UsageError(f"{name}: does not apply to --pair; expected one of them")
        if scene is None and size is not None:
            raise UsageError("--size: only applies to --scene; expected that too")
        found = None
        if scene is not None:
            found = adjusted(Scene.load(scene, by_name(define), allow_missing), spp, size)
        pair_gate(
            pair, found, scene, judged=judge, layer=layer, spp=spp, seed=seed,
            replicates=replicates, fixed=fixed, seconds=seconds, suffix=suffix, limit=limit,
            noise_free=noise_free, rim=rim, out=out, threads=threads, junit=junit, github=github,
            trace="" if scene is None else trace_command(scene, size, by_name(define)),
        )  # fmt: skip
    if judge:
        raise UsageError("--judge: only applies to --pair; expected that too")
    if [command is None, browser is None, not candidates].count(False) != 1:
        raise UsageError("expected either candidates, --command, --browser or --pair")
    driven = command is not None or browser is not None
    if driven and watch:
        raise UsageError("--watch: waits for files; expected candidates")
    driving: dict[str, Any] = {"replicates": replicates, "seed": seed, "suffix": suffix}
    driving |= {"time-limit": time_limit, "fixed": fixed or None}
    given = [name for name, value in driving.items() if value is not None]
    if not driven and given:
        raise UsageError(f"--{given[0]}: only applies to --command; expected that too")
    if browser is not None and suffix not in (None, ".npy", ".png"):
        raise UsageError(f"--suffix: {suffix} with --browser; expected .npy or .png")
    if scene is None and size is not None:
        raise UsageError("--size: only applies to --scene; expected that too")
    if scene is None and not driven and spp is not None:
        raise UsageError("--spp: only applies to --scene or --command; expected one of them")
    if truth is not None or derivative is not None:
        which = "--truth" if derivative is None else "--derivative"
        others: dict[str, Any] = {"scene": scene, "reference": reference, "size": size}
        if derivative is not None:
            others = {"truth": truth, "command": command, "reference-layer": reference_layer}
        others |= {"variance": variance, "baseline": baseline, "fixed": fixed, "rim": rim}
        others |= {"noise-free": noise_free, "witness": witness, "browser": browser}
        others |= {"allow-missing": allow_missing, "tone-curve": tone_curve, "from": renderer}
        others |= {"watch": watch, "beside": beside}
        for name, value in {**others, "junit": junit, "github": github, "define": define}.items():
            if value:
                raise UsageError(f"--{name}: does not apply to {which}; expected one of them")
    if truth is not None:
        numbers = {"replicates": replicates, "spp": spp, "seed": seed}
        truth_gate(truth, candidates or (), command, layer, out, suffix=suffix,
                   seconds=seconds, **numbers)  # fmt: skip
    if derivative is not None:
        derivative_gate(
            candidates or (), derivative, scene, reference or (), layer, out,
            spp=spp, size=size, limit=limit, step=step, threads=threads,
        )  # fmt: skip
    if beside and rim:
        raise UsageError("--beside: does not apply to --rim; expected one of them")
    shown = pictures_beside(beside or ())
    if step is not None:
        raise UsageError("--step: only applies to --derivative; expected that too")
    described = (
        None
        if scene is None
        else adjusted(Scene.load(scene, by_name(define), allow_missing), spp, size)
    )
    if renderer and baseline:
        raise UsageError("--from: a baseline is the renderer's own; expected one of them")
    reading = Reading.of(renderer, described, of_files=bool(reference))
    run, rounds = None, Rounds()
    if driven:
        noiseless = noise_free or (described is not None and is_noise_free(described))
        own, film = spp, None
        if described is not None:
            own = getattr(described.resolved_sampler, "spp", spp)
            film = (described.film.width, described.film.height)
        more: dict[str, Any] = {"spp": own, "size": film, "seconds": seconds or SECONDS}
        if browser is not None:
            data = None if scene is None else out / "candidates" / "scene.json"
            run = Command.of_page(browser, scene=data, suffix=suffix or ".npy", **more)
        else:
            run = Command(str(command), scene, suffix=suffix or ".exr", **more)
        run.arguments(out, 0)
        one = noiseless or browser is not None
        rounds = Rounds(
            1 if seed is None else seed,
            replicates or (1 if one else Rounds().replicates),
            None if fixed else seconds or SECONDS,
        )

    def tell(line: str) -> None:
        say(line, err=True)

    theirs = layer if reference_layer is None else reference_layer
    if reference_layer is not None and not reference:
        raise UsageError("--reference-layer: only applies to --reference; expected that too")
    name = baseline or ("" if described is None else described.name)
    name = printable(name or Path((reference or [Path("nothing")])[0]).stem)
    for_ci = Formats(junit, github)
    kept = () if run is None else ("candidates",)
    Outputs(out, ("results.json", "report.html"), kept, others=for_ci.files).prepare()

    def judge_once() -> int:
        """Write the outputs, say the verdict, and return its exit code."""
        started = time.perf_counter()
        driver: Driver | None = None
        failed: ReferenceRtError | None = None
        try:
            files = [p for path in reference or () for p in read_candidates(path, theirs)]
            request = Request(
                scene=reading.scene(described),
                references=reading.judge(files),
                variance=variance,
                baseline=baseline or "",
                baselines=baselines,
                limit=limit,
                noise_free=noise_free,
                tolerance=tolerance,
                tone_curve=tone_curve,
                threads=threads,
                rim=rim,
                name=name,
                witness=witness,
            )
            with ProgressLine() as progress:
                if run is not None:
                    if browser is not None and described is not None:
                        write_resolved(described, run.scene or out, float32=True)
                    driver = Driver(run, out / "candidates", progress.line, reading.read)
                    case = gated_renderer(request, driver, rounds, progress.line, progress)
                else:
                    pictures = [
                        p for path in candidates or () for p in read_candidates(path, layer)
                    ]
                    case = gated(request, reading.read(pictures), progress)
                case = with_others(reading.told(case), shown)
        except UsageError:
            raise
        except ReferenceRtError as error:
            failed = error
            if isinstance(error, SizeError) and command and size and "{width}" not in command:
                failed = SizeError(f"{error}; pass {{width}} and {{height}} to it in --command")
            case = not_run(name, failed)
        else:
            case = replace(
                case, seconds={"candidate": {"render": driver.seconds}} if driver else {}
            )
        trace = "" if scene is None else trace_command(scene, size, by_name(define))
        case = replace(case, again=shlex.join(["reference-rt", *sys.argv[1:]]), trace=trace)
        names = [str(path) for path in candidates or (driver.made if driver else ())]
        facts = {"limit": limit, "candidates": names}
        facts |= {"baseline": baseline} if baseline else {}
        facts |= {"command": command} if command else {}
        facts |= {"browser": browser} if browser else {}
        facts |= witness_facts(witness) | reading.facts(renderer)
        results, report = outputs.write(case, out, facts, time.perf_counter() - started)
        about = {} if scene is None else {case.scene: scene.as_posix()}
        for_ci.write("gate", [case], about, title=f"gate: {case.scene}")
        if failed is not None:
            raise failed
        say(f"{case.scene}: {case.verdict}: {headline(case)}")
        if case.cause is not None:
            say(f"  {case.cause.name}: {case.cause.evidence}")
        biases.tell(terminal.console(), case)
        tell(f"{results}, {report}")
        return outputs.code_of(case)

    if watch:
        watched = [*(candidates or ()), *(reference or ()), *([variance] if variance else ())]
        raise typer.Exit(judged_again(judge_once, watched))
    raise typer.Exit(judge_once())


def pictures_beside(given: Sequence[str]) -> dict[str, tuple["Picture", ...]]:
    """The pictures of NAME=FILE, by name.  Raises UsageError, ImageError."""
    from comparisons.gate.pictures_in import read_candidates

    found = {}
    for text in given:
        whose, _, file = text.partition("=")
        if not whose or not file or whose in found:
            expected = "a name for each" if whose in found else "NAME=FILE, such as Cycles=c.exr"
            raise UsageError(f"--beside: expected {expected}, got '{text}'")
        found[whose] = read_candidates(Path(file))
    return found


def with_others(case: "Case", pictures: Mapping[str, tuple["Picture", ...]]) -> "Case":
    """The case with other renderers' pictures for its page.  Raises ImageError."""
    from comparisons.gate.reference import check_sizes, size_of, stacked

    if case.images is None:
        return case
    others = dict(case.images.others)
    for whose, replicates in pictures.items():
        check_sizes(replicates, size_of(case.images.reference), "as the reference")
        others[whose] = stacked(replicates).mean(axis=0)
    return replace(case, images=replace(case.images, others=others))


def judged_again(judge: Callable[[], int], files: Sequence[Path]) -> int:
    """Judge, and again whenever one of the files has been written, until Ctrl-C; the last exit
    code.  Other signals end it as any command, with their own exit code.  Outputs of the judgement
    before stay until the next ones replace them."""
    while True:
        before = stamps(files)
        try:
            code = judge()
        except UsageError:
            raise
        except ReferenceRtError as error:
            say(f"error: {error}", err=True)
            code = error.exit_code
        say("waiting for another candidate; Ctrl-C ends", err=True)
        try:
            wait_for_change(files, before)
        except KeyboardInterrupt as error:
            if error.args not in ((), (signal.SIGINT,)):
                raise
            return code

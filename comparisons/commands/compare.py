"""`reference-rt compare`, `suite` and `report`, which writes their outputs again; `convert`, which
writes a scene for another renderer.
"""

import os
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from comparisons.commands.options import (
    ClusterFile,
    Fixed,
    Fresh,
    GitHub,
    JUnit,
    Scenes,
    Scheduler,
    Threads,
    TimeLimit,
    Witness,
    compare_extra,
    out_folder,
    some_of,
)
from comparisons.results.differentiators import DifferentiatorName, Guiding
from comparisons.results.rungs import COMPARED
from reference_rt.cli.guarded import guarded, say
from reference_rt.cli.options import AllowMissing, Defaults, by_name
from reference_rt.cli.quantities import seconds_of
from reference_rt.util.errors import SceneError, UsageError
from reference_rt.util.files import check_writable

if TYPE_CHECKING:
    from comparisons.suites.suite import Changes


@guarded
def compare(
    scenes: Annotated[
        list[Path],
        typer.Argument(
            metavar="SCENE...", help="Scene files: .yaml, .json, glTF, or Mitsuba's .xml."
        ),
    ],
    out: Annotated[Path, out_folder("results.json and report.html")] = Path("out"),
    spp: Annotated[
        int | None,
        typer.Option(
            help="Samples per pixel of each replicate. (default: an eighth of the scene's, in "
            "small pictures up to a quarter; with --replicates or --fixed all)"
        ),
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
            "(default: 8 to 24, by the noise; with --spp 8, with --fixed 16)",
        ),
    ] = None,
    time_limit: TimeLimit = None,
    fixed: Fixed = False,
    threads: Threads = None,
    fresh: Fresh = False,
    define: Defaults = None,
    allow_missing: AllowMissing = False,
    witness: Witness = None,
    variant: Annotated[
        Literal["fastest", "scalar_rgb", "llvm_ad_rgb", "cuda_ad_rgb"],
        typer.Option(
            help="Of Mitsuba: fastest takes cuda_ad_rgb where a GPU is present and it works."
        ),
    ] = "fastest",
    derivative: Annotated[
        str | None,
        typer.Option(
            metavar="PARAMETER",
            help="Compare Mitsuba's derivative of the picture by this parameter, such as "
            "materials.red.reflectance, with differences of ours. `explain --parameters` lists "
            "them.",
        ),
    ] = None,
    differentiator: Annotated[
        DifferentiatorName | None,
        typer.Option(
            "--derivative-integrator",
            help="Mitsuba's: prb, prb_basic, prb_projective or direct_projective. (default: prb)",
        ),
    ] = None,
    guiding: Annotated[
        Guiding | None,
        typer.Option(help="How it chooses the edges that it samples: none, grid or octree."),
    ] = None,
    step: Annotated[
        float | None,
        typer.Option(help="Of our differences, in the parameter's unit. (default: 1/256 of it)"),
    ] = None,
) -> None:
    """Render scenes with reference_rt and with Mitsuba, and report whether they agree.

    Noisy pictures are added, as many as their noise asks for, until they decide or --time-limit is
    reached: easy scenes are done sooner. The chance of a false alarm over all looks is that of one.
    The reference of an .xml scene is that file, loaded by Mitsuba.

    Finished cases are kept in the output folder and not run again.
    """
    if fixed and time_limit is not None:
        raise UsageError("got --fixed and --time-limit; expected one of them")
    if derivative is not None and witness:
        raise UsageError("got --derivative and --witness, which judges pictures; expected one")
    if derivative is None and (differentiator or guiding or step):
        raise UsageError("got an option of a derivative; expected --derivative PARAMETER, too")
    limit = None if time_limit is None else seconds_of(time_limit, "--time-limit")
    with compare_extra():
        from comparisons.mitsuba.backend import asked_for
        from comparisons.runs.processes import Children
        from comparisons.suites import worker_command

    # As `run_cases` does, which is imported while the worker is: before that begins.
    check_writable(*(out / name for name in ("results.json", "report.html", "cases/a case")))
    with asked_for(variant), closing(Children()) as children:
        if fresh or not (out / "cases").is_dir():  # where there is one, nothing may be left to do
            children.begin(tuple(worker_command(threads)))
        with compare_extra():
            from comparisons.compare.budget import Asked, usual
            from comparisons.compare.looks import SECONDS
            from comparisons.renderers import several
            from comparisons.results.case import exit_code
            from comparisons.suites.run import Options, Run, run_cases, summarise
            from comparisons.suites.suite import Changes, plan_of_files

        changes = Changes(
            spp=spp, size=size, seed=seed, defaults=by_name(define), allow_missing=allow_missing
        )
        seconds = SECONDS if limit is None else limit
        budget = usual(spp, replicates, seconds, fixed=fixed, witness=several(witness))
        if derivative is not None:
            asked = Asked(
                parameter=derivative,
                integrator=differentiator or "prb",
                guiding=guiding,
                step=step,
            )
            budget = budget.model_copy(update={"derivative": asked})
        plan = plan_of_files(scenes, changes, budget)
        if derivative is not None:
            from reference_rt.scene.parameters import parameter

            for one in plan.work:
                if not isinstance(one.scene, SceneError):
                    parameter(one.scene, derivative)
        given = {
            "replicates": replicates,
            "time-limit": time_limit,
            "fixed": fixed or None,
            "witness": witness,
            "derivative": derivative,
            "derivative-integrator": differentiator,
            "guiding": guiding,
            "step": step,
        }
        work = tuple(w._replace(again=_command(w.path, changes, given)) for w in plan.work)

        def tell(run: Run) -> None:
            summarise(run.cases, run.walls, run.not_run, run.missing, every=True)
            typer.echo(f"{options.results}, {options.report}", err=True)

        options = Options(
            out, threads=threads, fresh=fresh, steps=True, tell=tell, children=children
        )
        run = run_cases(plan._replace(work=work), options)
    raise typer.Exit(exit_code(run.cases, run.missing))


def _command(path: Path, changes: "Changes", given: Mapping[str, Any]) -> str:
    """The command that repeats one case alone;  given: other options."""
    import shlex

    options = {**changes.model_dump(exclude={"defaults", "allow_missing"}), **given}
    options["allow-missing"] = changes.allow_missing or None
    words = [
        f"--{name}"
        if value is True
        else f"--{name} {value:g}"
        if isinstance(value, float)
        else f"--{name} {shlex.quote(str(value))}"
        for name, values in options.items()
        for value in (values if isinstance(values, list) else [values])
        if value is not None
    ]
    words += [f"-D {shlex.quote(f'{k}={v}')}" for k, v in changes.defaults.items()]
    return " ".join(["reference-rt compare", shlex.quote(str(path)), "--fresh", *words])


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
    witness: Witness = None,
) -> None:
    """Compare all scenes of a folder with Mitsuba.

    Finished cases are kept in the output folder and not run again.
    """
    with compare_extra():
        from comparisons.renderers import several
        from comparisons.report.ci import Formats
        from comparisons.results.case import exit_code
        from comparisons.suites.run import Options, Run, run_suite, summarise
        from comparisons.suites.suite import Changes, load_suite, plan
    from reference_rt.cli.options import Where
    from reference_rt.util.files import check_writable
    from reference_rt.util.workers import Threads

    rungs = some_of("--rung", rung, COMPARED) if rung else ()
    source = load_suite(name)
    changes = Changes(defaults=by_name(define))
    planned = plan(source, scenes, tuple(only or ()), rungs, changes)
    if witness:
        asked = {"witness": several(witness)}
        work = (w._replace(budget=w.budget.model_copy(update=asked)) for w in planned.work)
        planned = planned._replace(work=tuple(work))
    folder = out or Path("out") / source.name
    where, cores = Where(workers, scheduler, cluster), os.cpu_count() or 1
    most = min(cores, MOST_WORKERS)
    # A cluster has as many cases at a time as threads.
    threads = 1 if where.is_cluster else max(cores // (workers or most), 1)
    files = {work.name: work.path.as_posix() for work in planned.work}
    for_ci = Formats(junit, github)
    check_writable(*for_ci.files)

    def tell(run: Run) -> None:
        """Write all outputs, after an interruption too: a build server must not show those of an
        earlier run."""
        for_ci.write(source.name, run.cases, files, run.walls, run.not_run, run.missing)
        summarise(run.cases, run.walls, run.not_run, run.missing)
        say(f"{options.results}, {options.report}", err=True)

    with closing(where.open(Threads, most)) as opened:
        options = Options(folder, rungs, opened, threads, fresh, tell=tell)
        run = run_suite(source, planned, options)
    raise typer.Exit(exit_code(run.cases, run.missing))


@guarded
def report(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="The output folder of `suite` or `compare`.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The page to write. (default: DIR/report.html)"),
    ] = None,
) -> None:
    """Write results.json and the page again, from the stored results of `suite` or `compare`.

    Exit code 1: cases are missing, because the run was interrupted.
    """
    with compare_extra():
        from comparisons.report import write_report, write_results
        from comparisons.results.case import how_many
        from comparisons.suites.run import check_stored_results, read_stored_results
    from reference_rt.util.files import check_writable

    page = out or folder / "report.html"
    results = folder / "results.json"
    check_stored_results(folder)
    check_writable(results, page)
    cases, walls, provenance, suite, not_run, missing = read_stored_results(folder)
    write_results(results, cases, provenance, suite, not_run, missing)
    write_report(
        page,
        cases,
        provenance,
        title=suite or "",
        walls=walls,
        not_run=not_run,
        missing=missing,
    )
    say(f"{how_many(len(cases), len(missing))}: {results}, {page}", err=True)
    raise typer.Exit(1 if missing else 0)


@guarded
def convert(
    scene: Annotated[
        Path, typer.Argument(metavar="SCENE", help="A Mitsuba .xml scene, a glTF one, or ours.")
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", help="A .yaml, .json, .xml (for Mitsuba), .pbrt, .glb or .gltf file."
        ),
    ],
    to: Annotated[
        Literal["scene", "json"],
        typer.Option(
            help="scene: by the file's suffix; json: everything resolved, shapes as triangles."
        ),
    ] = "scene",
    float32: Annotated[
        bool,
        typer.Option("--float32", help="With --to json: meshes of float32, which browsers read."),
    ] = False,
    define: Defaults = None,
    allow_missing: AllowMissing = False,
) -> None:
    """Write a scene in our format, for Mitsuba (.xml) or pbrt-v4 (.pbrt), as glTF (.glb, .gltf), or
    as data for other renderers (--to json), with its meshes and images in a folder beside it.

    Scenes in our format render without Mitsuba.
    """
    with compare_extra("converting"):
        from comparisons.gltf import write_gltf
        from comparisons.mitsuba.files import SUFFIXES, check_name, folder_of, write_scene
        from comparisons.pbrt import write_pbrt
        from comparisons.translator.resolved import write_resolved
        from comparisons.translator.writing import write_xml
    from reference_rt.rendering.scene import Scene
    from reference_rt.util.files import check_writable

    if float32 and to != "json":
        raise UsageError("--float32: is of --to json; expected that, too")
    others = {".xml": write_xml, ".pbrt": write_pbrt, ".glb": write_gltf, ".gltf": write_gltf}
    write = others.get(output.suffix.lower()) if to == "scene" else None
    if to == "scene" and write is None:
        check_name(output, (*SUFFIXES, *others))
    check_writable(output)
    found = Scene.load(scene, by_name(define), allow_missing)
    if write is not None:
        count, notes = write(found, output)
        for note in notes:
            say(f"note: {note}", err=True)
    elif to == "json":
        count = write_resolved(found, output, float32)
    else:
        count = write_scene(found, output)
    files = f", and {count} files in {folder_of(output)}" if count else ""
    say(f"{output}{files}", err=True)

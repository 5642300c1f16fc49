"""`reference-rt`: render, derivative, explain, warm-up, schema, and other packages' commands."""

import atexit
import gc
import importlib.metadata
import json
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer
import typer.core

from reference_rt.cli import defaults, options
from reference_rt.cli.guarded import guarded, is_output_lost, lost_output, say
from reference_rt.cli.options import (
    AllowMissing,
    Defaults,
    IntegratorName,
    SceneArgument,
    Seed,
    Size,
    adjusted,
    by_name,
    without_blas,
)
from reference_rt.util.errors import ImageError, UsageError, meant_by
from reference_rt.util.processes import catch_signals, exit_code_of


class _Commands(typer.core.TyperGroup):
    """Says what is meant by an option that there is not."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except Exception as found:
            error: Any = found
            if type(error).__name__ == "NoSuchOption" and error.ctx is not None:
                known = [name for option in error.ctx.command.params for name in option.opts]
                error.possibilities = meant_by(error.option_name, known)
            raise


app = typer.Typer(
    cls=_Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="An independent float64 reference ray tracer.\n\nExit codes: 0 success or agreement, "
    "1 difference, 2 usage, 3 invalid scene or image, 4 reference missing or could not run, "
    "5 internal error, 130 interrupted (by SIGTERM 143, by SIGHUP 129).",
)


Threads = Annotated[int | None, typer.Option(min=1, help="Default: all cores.")]


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"reference_rt {importlib.metadata.version('reference-rt')}")
        raise typer.Exit


@app.callback()
@guarded
def _options(
    context: typer.Context,
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Print the version.", is_eager=True, callback=_print_version
        ),
    ] = False,
) -> None:
    path = defaults.find(Path.cwd())
    name = context.invoked_subcommand
    group = context.command
    if path is not None and name is not None and isinstance(group, typer.core.TyperGroup):
        known = group.commands
        complete = not _OWN.issuperset(known)  # else those of other packages are not loaded
        context.default_map = {name: defaults.of_command(path, name, known, context, complete)}


@app.command()
@guarded
def render(
    scene: SceneArgument,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="An .exr (all layers) or .png file.")
    ],
    spp: Annotated[int | None, typer.Option(help="Samples per pixel.")] = None,
    size: Size = None,
    integrator: IntegratorName = None,
    seed: Seed = None,
    threads: Threads = None,
    define: Defaults = None,
    allow_missing: AllowMissing = False,
    time_limit: options.TimeLimit = None,
    target_error: options.TargetError = None,
    checkpoint: options.CheckpointFolder = None,
    no_checkpoint: options.NoCheckpoint = False,
    resume: options.Resume = False,
    more_spp: options.MoreSpp = None,
    preview: options.Preview = None,
    memory: options.Memory = None,
    workers: options.NumberOfWorkers = None,
    scheduler: options.Scheduler = None,
    cluster: options.ClusterFile = None,
) -> None:
    """Render a scene to a file.

    Ctrl-C writes the picture so far, marked as partial in its header.
    """
    from reference_rt.cli.options import Where
    from reference_rt.cli.render import Limited, Stored, render_to_file
    from reference_rt.rendering.image import check_suffix
    from reference_rt.rendering.scene import Scene
    from reference_rt.util.files import check_writable

    check_suffix(output)
    loaded = Scene.load(scene, by_name(define), allow_missing)
    description = adjusted(loaded, spp, size, integrator, seed)
    check_writable(output)
    where = Where(workers, scheduler, cluster, threads)
    limits = Limited(time_limit, target_error, memory)
    storage = Stored(checkpoint, no_checkpoint, resume, more_spp or 0)
    with without_blas():
        text, code = render_to_file(description, output, where, limits, storage, preview)
    say(text if code == 0 else f"error: {text}", err=True)
    if code:
        raise typer.Exit(code)


@app.command()
@guarded
def preview(
    scene: SceneArgument,
    to: Annotated[
        str,
        typer.Option(
            metavar="PLACE",
            help="window, terminal, kitty, sixel, blocks, or a .png file that is rewritten. "
            "(default: a window where there is a display, else SCENE.preview.png)",
        ),
    ] = "",
    spp: Annotated[
        int, typer.Option(min=1, help="Samples per pixel of the finished picture.")
    ] = 4096,
    target_error: Annotated[
        str, typer.Option(help="End at this relative standard error of the picture.")
    ] = "1%",
    size: Size = None,
    threads: Annotated[int | None, typer.Option(min=1, help="Default: all cores.")] = None,
    watch: Annotated[
        bool,
        typer.Option("--watch", help="Begin again whenever the scene or one of its files changes."),
    ] = False,
    define: Defaults = None,
    allow_missing: AllowMissing = False,
) -> None:
    """Show a picture of a scene that becomes less noisy until it is closed or interrupted."""
    from reference_rt.cli import preview as previews
    from reference_rt.cli.quantities import share_of
    from reference_rt.rendering.scene import Scene

    def load() -> Scene:
        return adjusted(Scene.load(scene, by_name(define), allow_missing), size=size)

    loaded = load()
    view = previews.view_of(to, loaded)
    wanted = previews.Wanted(spp, share_of(target_error, "--target-error"), threads)
    with without_blas():
        if watch:
            previews.watch(load, scene, view, wanted)
        else:
            previews.preview(loaded, view, wanted)


@app.command()
@guarded
def derivative(
    scene: SceneArgument,
    parameter: Annotated[
        str,
        typer.Argument(
            metavar="PARAMETER",
            help="Its path, such as shapes[0].radius or 'materials.red.reflectance[0]'; see "
            "explain --parameters.",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="An .exr (with standard errors and truncation) or a .png (red above 0, blue "
            "below).",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the numbers as JSON.")] = False,
    step: Annotated[
        float | None,
        typer.Option(help="In the parameter's unit. (default: 1/256 of its scale)"),
    ] = None,
    spp: Annotated[int | None, typer.Option(help="Samples per pixel of each picture.")] = None,
    size: Size = None,
    integrator: IntegratorName = None,
    seed: Seed = None,
    threads: Threads = None,
    define: Defaults = None,
    allow_missing: AllowMissing = False,
) -> None:
    """Compute the derivative of a picture by a parameter of its scene, and its error.

    By central differences with common random numbers: as costly as two pictures.
    """
    from reference_rt.cli import derivative as derivatives
    from reference_rt.rendering.image import check_suffix
    from reference_rt.rendering.scene import Scene
    from reference_rt.util.files import check_writable

    if output is None and not as_json:
        raise UsageError("expected --output, --json or both")
    if output is not None:
        check_suffix(output)
    loaded = adjusted(
        Scene.load(scene, by_name(define), allow_missing), spp, size, integrator, seed
    )
    check_writable(*([output] if output else []))
    with without_blas():
        found = derivatives.derivative(loaded, parameter, output, threads, step)
    for warning in found.warnings:
        say(f"warning: {warning}", err=True)
    say(derivatives.in_words(found, output), err=True)
    if as_json:
        say(derivatives.as_json(found))


@app.command()
@guarded
def trace(
    scene: SceneArgument,
    pixel: Annotated[
        str, typer.Option(metavar="X,Y", help="Column and row, from 0 on the left and the top.")
    ],
    sample: Annotated[int, typer.Option(min=0, help="Which of the pixel's samples.")] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Also write a page that draws the rays in the scene."),
    ] = None,
    spp: Annotated[int | None, typer.Option(help="Samples per pixel.")] = None,
    size: Size = None,
    integrator: IntegratorName = None,
    seed: Seed = None,
    define: Defaults = None,
    allow_missing: AllowMissing = False,
) -> None:
    """Show the rays of one sample of a pixel: what they hit, and what each adds to its value.

    The numbers are those of `render`, to the last bit.
    """
    from reference_rt.cli import trace as tracing
    from reference_rt.rendering.scene import Scene
    from reference_rt.util.files import check_writable

    described = Scene.load(scene, by_name(define), allow_missing)
    loaded = adjusted(described, spp, size, integrator, seed)
    if out is not None:
        check_writable(out)
    with without_blas():
        tree = tracing.traced(loaded, pixel, sample)
        if as_json:
            typer.echo(tracing.as_json(tree))
        else:
            tracing.print_tree(loaded, tree)
        if out is not None:
            tracing.write_page(loaded, tree, out)
            say(f"{out}: {len(tree['rays'])} rays", err=True)


@app.command()
@guarded
def explain(
    scene: SceneArgument,
    define: Defaults = None,
    allow_missing: AllowMissing = False,
    parameters: Annotated[
        bool,
        typer.Option("--parameters", help="List what `derivative` can be asked, with values."),
    ] = False,
    units: Annotated[
        bool,
        typer.Option(
            "--units", help="What other renderers' lamps are given for the light of its lamps."
        ),
    ] = False,
    witness: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="Whether a third renderer may vote on it: cycles or povray."
        ),
    ] = None,
) -> None:
    """Print what a scene uses, how near to float64's limits it is, and its kernels."""
    from reference_rt.cli.explain import print_page, print_witness
    from reference_rt.rendering.scene import Scene

    loaded = Scene.load(scene, by_name(define), allow_missing)
    if witness is not None:
        print_witness(loaded, witness)
        return
    if parameters:
        from reference_rt.cli.derivative import lines_of

        for line in lines_of(loaded):
            say(line)
        return
    if units:
        from reference_rt.cli.units import lines_of as units_of

        for line in units_of(loaded):
            say(line)
        return
    print_page(loaded)


@app.command("warm-up")
@guarded
def warm_up(
    scenes: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[SCENE]...",
            help="Whose kernels are compiled, too, if its tables are of rare types.",
        ),
    ] = None,
    threads: Threads = None,
) -> None:
    """Compile all kernels that scenes share, so that no render waits for them.

    If it is interrupted, the kernels that are compiled by then are kept.
    """
    from reference_rt.cli.warm_up import warm_up as compile_kernels
    from reference_rt.rendering.scene import Scene

    with without_blas():
        done = compile_kernels([Scene.load(scene) for scene in scenes or ()], threads)
    say(
        f"{done.folder}: {done.compiled} kernels compiled, {done.cached} were in the cache, "
        f"{done.seconds:.1f} s"
    )


@app.command()
@guarded
def doctor() -> None:
    """Print what is installed, what works, and the caches; exit code 1 if something does not."""
    from reference_rt.cli.doctor import checks, page

    found = []
    for check in checks():  # one after another: some take seconds
        found.append(check)
        for line in page([check]):
            say(line)
    if not all(check.works for check in found):
        raise typer.Exit(1)


@app.command()
@guarded
def check(
    scenes: Annotated[
        list[Path], typer.Argument(help="Scene files, such as those that a commit changes.")
    ],
    allow_missing: AllowMissing = False,
) -> None:
    """Read scene files and the files that they name, and print their errors; exit code 3 if there
    is one."""
    from reference_rt.rendering.scene import Scene
    from reference_rt.util.errors import SceneError

    wrong = 0
    for path in scenes:
        try:
            assert Scene.load(path, {}, allow_missing).tables  # reads the files that it names
        except SceneError as error:
            wrong += 1
            for one in (error, *error.others):
                say(f"error: {one}", err=True)
    if wrong:
        raise typer.Exit(SceneError.exit_code)


@app.command()
@guarded
def schema() -> None:
    """Print the JSON Schema of scene files."""
    from reference_rt.scene.model import json_schema

    typer.echo(json.dumps(json_schema(), indent=2))


_OWN = {
    command.name or getattr(command.callback, "__name__", "") for command in app.registered_commands
}
"""This package's commands, for which those of others, whose imports take 0.03 s, are not needed."""


def _add_commands() -> None:
    """Register the commands of installed packages; a broken one must not disable the others."""
    for entry in importlib.metadata.entry_points(group="reference_rt.commands"):
        try:
            entry.load()(app)
        except ImportError as error:
            typer.echo(f"warning: command '{entry.name}' is not available: {error}", err=True)


def main() -> None:
    """The `reference-rt` program."""
    catch_signals()
    try:
        if not _OWN.intersection(sys.argv[1:2]):
            _add_commands()
        gc.freeze()  # exclude the imported modules from collections: saves 0.04 s
        atexit.register(gc.freeze)  # and all objects from the one when Python exits: saves 0.07 s
        # Compiling makes millions of small objects, few of them in cycles.  The first render of
        # mesh_knot takes 11.0 CPU seconds with a threshold of 20,000, 9.9 with this one and 12 MB
        # more, and 9.9 with a million and 80 MB more.
        gc.set_threshold(300_000)
        app()
    except KeyboardInterrupt as error:  # outside of a command: commands handle it themselves
        sys.exit(exit_code_of(error))
    except OSError as error:  # printing outside of a command, such as --help
        if not is_output_lost(error):
            raise
        with suppress(OSError):
            say(f"error: {lost_output(error)}", err=True)
        # Flushing the rest of the buffer would fail again when Python exits.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        sys.exit(ImageError.exit_code)

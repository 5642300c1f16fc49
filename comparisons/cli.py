"""The commands that `comparisons` adds to `reference-rt`."""

from pathlib import Path
from typing import Annotated

import typer

from reference_rt.cli import adjusted, guarded
from reference_rt.errors import ReferenceUnavailableError
from reference_rt.scene import Scene


def register(app: typer.Typer) -> None:
    """Add the commands; called through the entry-point group `reference_rt.commands`."""
    app.command()(compare)


@guarded
def compare(
    scenes: Annotated[
        list[Path], typer.Argument(metavar="SCENE...", help="Scenes: .yaml or .json.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for results.json and report.html.")] = Path(
        "out"
    ),
    spp: Annotated[int | None, typer.Option(help="Samples per pixel of each replicate.")] = None,
    size: Annotated[str | None, typer.Option(help="WIDTHxHEIGHT in pixels.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the first replicate.")] = None,
    replicates: Annotated[
        int, typer.Option(min=2, help="Independent renderings on each side (path tracing).")
    ] = 16,
    threads: Annotated[int | None, typer.Option(min=1, help="Default: all cores.")] = None,
) -> None:
    """Render scenes here and in Mitsuba, and say whether they agree."""
    # Imported here: `reference-rt render` must not wait for what only comparing needs.
    try:
        from comparisons.compare import Options, compare_scenes
        from comparisons.verdict import exit_code
    except ModuleNotFoundError as error:
        raise ReferenceUnavailableError(
            f"comparing needs {error.name}: pip install 'reference-rt[compare]'"
        ) from None

    descriptions = [adjusted(Scene.load(path), spp, size, None, seed) for path in scenes]
    cases = compare_scenes(descriptions, out, Options(replicates, threads))
    raise typer.Exit(exit_code(cases))

"""`reference-rt convert`."""

from pathlib import Path
from typing import Annotated

import typer

from comparisons.commands.extra import compare_extra
from reference_rt.cli.defaults import Defaults, by_name
from reference_rt.cli.main import guarded, say


@guarded
def convert(
    scene: Annotated[
        Path, typer.Argument(metavar="SCENE", help="A Mitsuba .xml scene, or one of ours.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="A .yaml or .json file.")],
    define: Defaults = None,
) -> None:
    """Write a scene in our format, with its meshes and images in a folder beside it.

    The result renders without Mitsuba.
    """
    with compare_extra("converting"):
        from comparisons.mitsuba.reading.write import check_name, folder_of, write_scene
    from reference_rt.rendering.scene import Scene
    from reference_rt.util.files import check_writable

    check_name(output)
    check_writable(output)
    count = write_scene(Scene.load(scene, by_name(define)), output)
    files = f", and {count} files in {folder_of(output)}" if count else ""
    say(f"{output}{files}", err=True)

"""`reference-rt convert`."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from comparisons.commands.options import AllowMissing, compare_extra
from reference_rt.cli.adjusted import Defaults, by_name
from reference_rt.cli.guarded import guarded, say


@guarded
def convert(
    scene: Annotated[
        Path, typer.Argument(metavar="SCENE", help="A Mitsuba .xml scene, or one of ours.")
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="A .yaml, .json or (for Mitsuba) .xml file.")
    ],
    to: Annotated[
        Literal["scene", "json"],
        typer.Option(
            help="scene: by the file's suffix; json: everything resolved, shapes as triangles."
        ),
    ] = "scene",
    define: Defaults = None,
    allow_missing: AllowMissing = False,
) -> None:
    """Write a scene in our format, as a Mitsuba scene (.xml), or as data for other renderers
    (--to json), with its meshes and images in a folder beside it.

    Scenes in our format render without Mitsuba.
    """
    with compare_extra("converting"):
        from comparisons.mitsuba.writing import write_xml
        from comparisons.mitsuba.writing.files import SUFFIXES, check_name, folder_of, write_scene
        from comparisons.mitsuba.writing.resolved import write_resolved
    from reference_rt.rendering.scene import Scene
    from reference_rt.util.files import check_writable

    is_mitsuba = output.suffix.lower() == ".xml" and to == "scene"
    if to == "scene" and not is_mitsuba:
        check_name(output, SUFFIXES)
    check_writable(output)
    found = Scene.load(scene, by_name(define), allow_missing)
    if is_mitsuba:
        count, notes = write_xml(found, output)
        for note in notes:
            say(f"note: {note}", err=True)
    elif to == "json":
        count = write_resolved(found, output)
    else:
        count = write_scene(found, output)
    files = f", and {count} files in {folder_of(output)}" if count else ""
    say(f"{output}{files}", err=True)

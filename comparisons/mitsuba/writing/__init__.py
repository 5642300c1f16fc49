"""Scene -> a Mitsuba scene file, .xml, with its meshes and images in a folder beside it.

Contract: Mitsuba loads the file and renders the same picture, and `comparisons.mitsuba.reading`
reads it to a scene with the same picture, to the same bits where Mitsuba has the shapes and
materials.  Numbers have all their digits; transforms are the steps that the scene has.  Where
Mitsuba has no plugin, ours is named, or a mesh stands in: notes say so.

To write another type: a case in `views` (cameras, lights), in `surfaces` (textures) or in `shapes`;
materials are those of `comparisons.mitsuba.translate`.
"""

from pathlib import Path

from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.translate.textures import UntranslatableError
from comparisons.mitsuba.writing import views
from comparisons.mitsuba.writing.files import Files, check_name, write_files
from comparisons.mitsuba.writing.shapes import Shapes
from comparisons.mitsuba.writing.surfaces import Surfaces
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import SceneError

VERSION = "3.0.0"
"""The version of Mitsuba's format."""


def write_xml(scene: Scene, path: Path) -> tuple[int, list[str]]:
    """Write a scene as .xml, whole or not at all; how many files it has besides, and notes on what
    is not quite the same.

    Raises SceneError, also for what Mitsuba lacks; UsageError, ImageError,
    ReferenceUnavailableError.
    """
    check_name(path, (".xml",))
    mitsuba()
    notes: list[str] = []

    def text(files: Files) -> str:
        surfaces = Surfaces(scene, files)
        shapes = Shapes(surfaces).elements()
        integrator = views.integrator(scene, surfaces)
        lights = views.lights(scene, surfaces)
        elements = [
            integrator,
            views.sensor(scene, surfaces),
            *surfaces.textures.values(),
            *surfaces.elements.values(),
            *shapes,
            *lights,
        ]
        notes.extend(surfaces.notes)
        head = [f"<!-- {' '.join(_plain(line).split())} -->" for line in _comments(scene, notes)]
        body = ["    " + line for element in elements for line in element.lines()]
        return "\n".join([*head, f'<scene version="{VERSION}">', *body, "</scene>", ""])

    try:
        return write_files(scene, path, text), notes
    except UntranslatableError as error:
        raise SceneError(
            f"{scene.name}: the {error.kind} {error.part} has no counterpart among Mitsuba's; "
            "expected a scene without it"
        ) from None


def _comments(scene: Scene, notes: list[str]) -> list[str]:
    found = [f"Written by reference-rt from the scene {scene.name}."]
    return found + [f"Note: {note}." for note in notes]


def _plain(text: str) -> str:
    """Text that a comment may hold."""
    return text.replace("--", "- -")

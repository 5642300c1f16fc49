"""Scene -> a scene file of pbrt-v4, .pbrt, with its meshes and images in a folder beside it.

- `surfaces`: the format's words, materials and textures;  `views`: camera, film, sampler,
  integrator and lights;  `shapes`: shapes and instances.

Contract: pbrt is given what the scene describes, in world coordinates, in linear sRGB.  Where pbrt
computes almost the same, notes say so; what it cannot express raises SceneError with all reasons.
pbrt itself is not needed, and nothing here was ever run by it: the tests check the grammar, and
evaluate what is written.

To write another type: a case in one of these; the tables of the tests say what pbrt accepts.
"""

from pathlib import Path

from comparisons.mitsuba.writing.files import Files, check_name, write_files
from comparisons.pbrt.shapes import shapes_of
from comparisons.pbrt.surfaces import Writing
from comparisons.pbrt.views import camera_of, film_of, integrator_of, lights_of, sampler_of
from reference_rt.rendering.scene import Scene


def write_pbrt(scene: Scene, path: Path) -> tuple[int, list[str]]:
    """Write a scene as .pbrt, whole or not at all; how many files it has besides, and notes on what
    is not quite the same.

    Raises SceneError with all reasons why pbrt cannot express it; UsageError, ImageError.
    """
    check_name(path, (".pbrt",))
    notes: list[str] = []

    def text(files: Files) -> str:
        writing = Writing(scene, files)
        head = ['Option "disabletexturefiltering" true']
        with writing.collected("camera"):
            head += camera_of(scene.camera, scene.film)
        with writing.collected("integrator"):
            head.append(integrator_of(scene.integrator))
            with writing.collected("sampler"):
                head.append(sampler_of(scene.resolved_sampler))
        head += film_of(scene.film, f"{path.stem}.exr")
        shapes, world = shapes_of(writing), lights_of(writing)
        if scene.film.layers:
            writing.note("the film's layers are left out")
        if writing.one_sided:
            behind = ", ".join(f"'{name}'" for name in sorted(writing.one_sided))
            writing.note(f"black from behind, and not so in pbrt: {behind}")
        writing.check()
        notes.extend(writing.notes)
        comments = [f"Written by reference-rt from the scene {scene.name}."]
        comments += [f"Note: {note}." for note in notes]
        lines = [f"# {' '.join(line.split())}" for line in comments]
        return "\n".join([*lines, *head, "WorldBegin", *world, *writing.lines, *shapes, ""])

    return write_files(scene, path, text), notes

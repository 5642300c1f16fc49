"""Makes docs/pictures/ and docs/gallery.md: `python docs/make_pictures.py [NAME...]`.

The gallery has every scene of scenes/; the first picture of README.md is a comparison with Mitsuba;
the pictures of docs/truth.md are the formulas' own; those of docs/course are what its Python
writes.  NAME: only the pictures of these scenes, or `compare`, `truth` or `course`; the gallery is
always written.
"""

import json
import re
import shutil
import sys
from collections.abc import Iterable
from contextlib import chdir
from pathlib import Path

import matplotlib as mpl
import numpy as np
from docs_pages import DOCS, run, save
from PIL import Image

from comparisons.compare.budget import Budget
from comparisons.compare.compare import Subject, gather
from comparisons.compare.judge import judge
from comparisons.truth.case import cases
from comparisons.truth.outputs import formula_picture
from reference_rt import Scene, render
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.image import display, srgb
from reference_rt.util.files import read_text, replacing, temporary_folder

mpl.use("Agg")
from matplotlib import pyplot as plt

SCENES = DOCS.parent / "scenes"
PICTURES = DOCS.absolute() / "pictures"

LARGE = (
    "cornell_box",
    "textured_room",
    "caustic_glass",
    "whitted_classic",
    "mesh_knot",
    "csg_dice",
)
WIDE, NARROW, TRUTH = 400, 240, 96
"""Widths in pixels of the large pictures, of the others, and of those of truth."""

SAMPLES = 128
"""Least samples per pixel of pictures with noise."""

GROUPS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    (
        "Media",
        "What fills the space between surfaces: fog, smoke, milk and coloured glass.",
        (
            *("absorbing_glass", "cloud_of_instances", "coloured_fog", "csg_smoke", "fog"),
            *("milk_glass", "nested_media"),
        ),
    ),
    ("Solids", "Set operations on shapes: union, intersection, difference.", ("csg_",)),
    ("Materials", "One material each, on the same shapes.", ("material_", "texture")),
    ("Lights", "", ("light_", "environment", "many_lights", "soft_shadows", "tilted_lamps")),
    ("Cameras and filters", "", ("camera_", "filter_")),
)
"""Title, text and the beginnings of the names of scenes."""


def main() -> None:
    """Write all pictures and the page."""
    (PICTURES / "scenes").mkdir(parents=True, exist_ok=True)
    paths = sorted(SCENES.glob("*.yaml"))
    wanted = sys.argv[1:] or [*(path.stem for path in paths), "compare", "truth", "course"]
    for path in paths:
        if path.stem in wanted:
            picture_of(path)
    with replacing(DOCS / "gallery.md") as temporary:
        temporary.write_text("\n".join(page(paths)) + "\n", encoding="utf-8")
    if "compare" in wanted:
        comparison()
    if "truth" in wanted:
        formulas()
    if "course" in wanted:
        course()


def picture_of(path: Path) -> None:
    """The picture of a scene as its command line shows it, as JPEG."""
    scene = Scene.load(path)
    film, sampler = scene.film, scene.resolved_sampler
    width = WIDE if path.stem in LARGE else NARROW
    height = round(film.height * width / film.width)
    if not scene.integrator.deterministic and sampler.type != "grid":
        sampler = sampler.model_copy(update={"spp": max(sampler.spp, SAMPLES)})
    film = film.model_copy(update={"width": width, "height": height})
    picture = render(scene.changed(film=film, sampler=sampler))
    values = np.round(255.0 * np.clip(display(picture), 0.0, 1.0)).astype(np.uint8)
    save(PICTURES / "scenes" / f"{path.stem}.jpg", values)
    print(path.stem, flush=True)


def page(paths: Iterable[Path]) -> Iterable[str]:
    """The lines of the gallery."""
    rest = list(paths)
    yield "# Gallery"
    yield ""
    yield "All scenes of the repository. `reference-rt render` makes the pictures; the verdict"
    yield "against Mitsuba is that of `reference-rt suite smoke`, where that has one: it leaves out"
    yield "light on solids, which takes long, and is too noisy for a few. The page of"
    yield "[truth](truth.md) has the scenes whose pixels are known by formula."
    stress = [path for path in rest if read_text(path).startswith("# Stiff")]
    large = [path for path in rest if path.stem in LARGE]
    yield from section("A few large ones", "", large)
    rest = [path for path in rest if path not in stress and path not in large]
    for title, text, beginnings in GROUPS:
        of_group = [path for path in rest if path.stem.startswith(beginnings)]
        rest = [path for path in rest if path not in of_group]
        yield from section(title, text, of_group)
    yield from section("Others", "", rest)
    text = "Each is extreme in one way. The text says what to look for in the picture."
    yield from section("Stress scenes", text, stress)


def section(title: str, text: str, paths: Iterable[Path]) -> Iterable[str]:
    """A heading, and a card for each scene: its picture, words, file and verdict."""
    yield from ("", f"## {title}", "")
    if text:
        yield from (text, "")
    yield '<div class="grid cards" markdown>'
    known = verdicts()
    for path in paths:
        name = path.stem
        verdict = f" · {known[name]}" if name in known else ""
        yield ""
        yield f"-   ![{name}](pictures/scenes/{name}.jpg)"
        yield ""
        yield f"    **{name}**: {words(path)} [scene](../scenes/{name}.yaml){verdict}"
    yield from ("", "</div>")


def verdicts() -> dict[str, str]:
    """By scene, of the last `reference-rt suite smoke`; without one, those on the page."""
    results = DOCS.parent / "out" / "smoke" / "results.json"
    if not results.exists():
        page = read_text(DOCS / "gallery.md")
        return dict(re.findall(r"/(\w+)\.yaml\) · (\[.*?\]\(verdict\.md\))$", page, re.MULTILINE))
    cases = {case["scene"]: case["verdict"] for case in json.loads(read_text(results))["cases"]}
    return {k: f"[{v}](verdict.md)" for k, v in cases.items() if v != "inconclusive"}


def words(path: Path) -> str:
    """The description of a scene; of a stress scene, what its first lines say."""
    comment = []
    for line in read_text(path).splitlines():
        if not line.startswith("#"):
            break
        comment.append(line.lstrip("# "))
    text = " ".join(comment).removeprefix("Stiff: ") or Scene.load(path).description
    return (text[:1].upper() + text[1:]).replace("|", "\\|").rstrip(".") + "."


def comparison() -> None:
    """Both pictures of the Cornell box, and the difference in standard errors."""
    subject, budget = Subject(Scene.load(SCENES / "cornell_box.yaml")), Budget()
    evidence = gather(subject, budget, lambda line: None)
    case = judge(evidence, budget.limit)
    images = evidence.rendered.images
    error = np.maximum(images.error, 1e-12)
    z = ((images.candidate - images.reference) / error).mean(axis=-1) * 3.0**0.5
    figure, axes = plt.subplots(1, 3, figsize=(9.0, 3.45), layout="constrained")
    for axis, title, image in (
        (axes[0], "reference_rt", shown(images.candidate)),
        (axes[1], "Mitsuba 3", shown(images.reference)),
    ):
        axis.imshow(image)
        axis.set_title(title, fontsize=10)
    drawn = axes[2].imshow(z, cmap="RdBu_r", vmin=-4, vmax=4)
    axes[2].set_title("difference / standard error", fontsize=10)
    figure.colorbar(drawn, ax=axes[2], fraction=0.046, pad=0.02, ticks=[-4, -2, 0, 2, 4])
    for axis in axes:
        axis.set_xticks([])
        axis.set_yticks([])
    figure.suptitle(f"cornell_box: {case.verdict}", fontsize=11)
    with replacing(PICTURES / "compare.png") as temporary:
        figure.savefig(temporary, dpi=110, format="png")
    print(case.verdict, case.reason)


def formulas() -> None:
    """What each case of truth expects, as PNG."""
    (PICTURES / "truth").mkdir(exist_ok=True)
    for case in cases().values():
        values = np.rint(formula_picture(case.compute())).astype(np.uint8)
        size = -(-TRUTH // len(values))
        image = Image.fromarray(values.repeat(size, axis=0).repeat(size, axis=1))
        with replacing(PICTURES / "truth" / f"{case.name}.png") as temporary:
            image.save(temporary, "PNG", optimize=True)


def course() -> None:
    """What the Python of the course writes; it may load scenes of the repository."""
    (PICTURES / "course").mkdir(exist_ok=True)
    with temporary_folder() as folder, chdir(folder):
        Path("scenes").symlink_to(SCENES.absolute())
        for path in sorted((DOCS / "course").glob("*.md")):
            list(run(path, lambda command: None))
        for path in Path().glob("*.png"):
            shutil.copy(path, PICTURES / "course")


def shown(image: FloatArray) -> FloatArray:
    return srgb(np.clip(image, 0.0, 1.0))


if __name__ == "__main__":
    main()

"""Hostile scenes and files."""

import base64
import json
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.experiments.fuzz.assets import MESHES, SOUND_IMAGES, files, write, write_files
from comparisons.experiments.stability.harness.outcomes import (
    EXAMPLES,
    MITSUBA,
    OURS,
    Outcome,
    Outcomes,
)
from comparisons.experiments.stability.harness.series import Draw, Sweep, series
from comparisons.experiments.stability.hostile.bases import BASES, PLAIN
from comparisons.experiments.stability.hostile.damage import (
    YAML_PIECES,
    as_text,
    as_yaml,
    damaged,
    deep,
    pick,
    sentence,
    with_numbers,
    with_structure,
)
from comparisons.experiments.stability.hostile.worker import Answer, answers, judged_of_mitsuba
from reference_rt.util.errors import MOST_TOLD

FOR_MITSUBA = {"quick": 8, "full": 60}
"""Scenes of a sweep point that Mitsuba gets: each takes it some 0.1 s, after 2 s to start."""

LONGEST = 2000
"""Characters of a scene that an example quotes."""


def problem(answer: Answer, scene: Path) -> str | None:
    """How a case breaks the law; None where it does not."""
    if answer.exit is None:
        return answer.said
    if answer.exit not in (0, 3):
        return f"exit code {answer.exit}: {answer.said[-300:]}"
    if answer.exit == 0:
        return f"{answer.nonfinite} pixels not finite, not told" if answer.nonfinite else None
    # Before the errors may be warnings of parts that are read whatever is wrong with others.
    lines = [line for line in answer.said.splitlines() if not line.startswith("warning: ")]
    if not 1 <= len(lines) <= MOST_TOLD or not all(line.startswith("error: ") for line in lines):
        return f"not one line of error for each problem: {answer.said[:300]!r}"
    for line in lines:
        if str(scene.parent) not in line:
            return f"names no file: {line[:300]}"
        if "expected" not in line and "malformed" not in line:
            return f"says not what was expected: {line[-300:]}"
    return None


def example(scene: Path, what: str) -> Mapping[str, Any]:
    """The input word for word, and what came of it."""
    content = scene.read_bytes()
    found = {"suffix": scene.suffix, "came": what, "expected": "one line of error or a picture"}
    try:
        text = content.decode()
    except UnicodeDecodeError:
        return found | {"base64": base64.b64encode(content).decode()[:LONGEST]}
    found |= {"scene": text[:LONGEST]}
    for name in scene.parent.glob(f"{scene.stem}_*"):
        found |= {"file": name.name, "base64": base64.b64encode(name.read_bytes()).decode()}
    return found


def judged(
    scenes: Sequence[Path], plain: bool, signatures: Sequence[str | None] | None = None
) -> Outcome:
    """The outcome of scenes; those whose kernels differ from `signatures` run in plain Python."""
    failures, examples, left = 0, [], []
    for scene, answer in zip(
        scenes, answers(scenes, "plain" if plain else "ours", signatures), strict=True
    ):
        if signatures is not None and answer.exit == 0 and not answer.rendered:
            left.append(scene)
            continue
        what = problem(answer, scene)
        if what is not None:
            failures += 1
            examples.append(example(scene, what))
    found = Outcome(len(scenes) - len(left), failures, None, 0, tuple(examples[:EXAMPLES]))
    return found + judged(left, True) if left else found


Make = Callable[[Draw, float, str, int], tuple[str, str | bytes]]
"""Suffix and content of a scene file, of x, the sound scene or file, and the case's number."""

_COUNTS = (1.0, 2.0, 4.0, 8.0)


def _written(draw: Draw, x: float, names: Sequence[str], make: Make) -> list[tuple[Path, str]]:
    """Scene files beside the sound files, with the base that each was made from."""
    write_files(draw.folder)
    found = []
    for k in range(draw.cases):
        name = pick(draw.rng, names)
        suffix, content = make(draw, x, name, k)
        path = draw.folder / f"case{k}{suffix}"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        found.append((path, name))
    return found


_known: dict[str, str | None] = {}
"""Signatures of sound scenes, by their text."""


def _signatures(draw: Draw, sound: Mapping[str, Any]) -> dict[str, str | None]:
    """Of the sound scenes, which are rendered first, so that what has to compile does."""
    texts = {name: as_text(data) for name, data in sound.items()}
    new = [text for text in texts.values() if text not in _known]
    paths = [draw.folder / f"sound{k}.json" for k in range(len(new))]
    for path, text in zip(paths, new, strict=True):
        path.write_text(text)
    _known.update(zip(new, [answer.signature for answer in answers(paths)], strict=True))
    return {name: _known[text] for name, text in texts.items()}


def _values_of(draw: Draw, x: float, name: str, _: int) -> tuple[str, str]:
    return ".json", as_text(with_numbers(draw.rng, BASES[name], int(x)))


@series(
    Sweep("hostile numbers in a scene", (*_COUNTS, 16.0), (1.0, 4.0), 60, 900),
    explained="None of this hangs on precision: what is refused is refused by rules, and Mitsuba's "
    "range of float32 is left by a single hostile number already.",
)
def values(draw: Draw, x: float) -> Outcomes:
    """Numbers of four sound scenes (every shape; materials and lights; recursive; layers) replaced
    by hostile ones. A crash, a hang, a traceback, an unclear error or a pixel that is not finite
    and not reported breaks the law."""
    made = _written(draw, x, list(BASES), _values_of)
    known = _signatures(draw, BASES)
    found = {OURS: judged([path for path, _ in made], False, [known[name] for _, name in made])}
    if draw.mitsuba:
        # The others have solids, or what Mitsuba has no twin of.
        lit = [path for path, name in made if name in ("light", "recursive")]
        found[MITSUBA] = judged_of_mitsuba(lit[: FOR_MITSUBA[draw.effort]])
    return found


def _in_plain_python(names: Sequence[str], sweep: Sweep) -> Callable[[Make], Make]:
    """Register what makes scenes as a series of such, rendered by plain Python;  names: of the
    sound scenes that they are made of."""

    def register(make: Make) -> Make:
        @series(sweep)
        @wraps(make)
        def measure(draw: Draw, x: float) -> Outcomes:
            return {OURS: judged([path for path, _ in _written(draw, x, names, make)], True)}

        return make

    return register


@_in_plain_python(PLAIN, Sweep("changes of what is where", _COUNTS, (2.0,), 50, 400))
def structure(draw: Draw, x: float, name: str, k: int) -> tuple[str, str]:
    """Values of other types, keys that are missing, new or moved, long lists, deep trees."""
    with deep():
        data = with_structure(draw.rng, BASES[name], int(x))
        return (".json", as_text(data)) if k % 4 else (".yaml", as_yaml(data))


@_in_plain_python(
    ("",), Sweep("share of hostile values", (0.001, 0.01, 0.03, 0.1), (0.01,), 30, 400)
)
def grammar(draw: Draw, x: float, _: str, __: int) -> tuple[str, str]:
    """Scenes of the fuzzer, of which some numbers, names and values are hostile."""
    return ".json", as_text(sentence(draw.rng, x, write(draw.folder)))


@_in_plain_python(PLAIN, Sweep("damages of a scene's text", _COUNTS, (1.0,), 16, 120))
def text(draw: Draw, x: float, name: str, k: int) -> tuple[str, bytes]:
    """Bytes of YAML that are flipped, cut or repeated; tags, anchors, other documents, and aliases
    of aliases that stand for up to 9^24 things."""
    if k % 8 == 0:
        return ".yaml", bomb(draw.rng, int(x)).encode()
    sound = as_yaml(BASES[name]).encode()
    return ".yaml", damaged(draw.rng, sound, int(x), YAML_PIECES)


def bomb(rng: np.random.Generator, levels: int) -> str:
    """Aliases of aliases: 9^(3 levels) things, in place of something of the scene."""
    lines = ["a0: &a0 [0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 3 * levels)]
    key = pick(rng, ("shapes", "lights", "materials", "camera", "description", "groups"))
    return "\n".join([*lines, f"{key}: *a{3 * levels - 1}", ""])


_EYE = {"type": "perspective", "eye": [0.0, 0.0, 4.0], "target": [0.0, 0.0, 0.0]}


def _mesh_scene(file: str) -> dict[str, Any]:
    return {
        "camera": _EYE,
        "integrator": {"type": "ray_cast"},
        "shapes": [{"type": "mesh", "file": file}],
    }


def _image_scene(file: str) -> dict[str, Any]:
    texture = {"type": "bitmap", "file": file}
    return {
        "camera": _EYE,
        "integrator": {"type": "path", "max_depth": 3},
        "textures": {"t": texture},
        "materials": {"m": {"type": "diffuse", "reflectance": "t"}},
        "shapes": [{"type": "rectangle", "material": "m"}],
        "lights": [{"type": "environment_map", "file": file}],
    }


def _damaged(draw: Draw, x: float, names: Sequence[str], scene: Callable[[str], Any]) -> Outcomes:
    """Of scenes that name one damaged file each."""

    def make(draw: Draw, x: float, name: str, k: int) -> tuple[str, str]:
        file = f"case{k}_{name}"
        (draw.folder / file).write_bytes(damaged(draw.rng, files()[name], int(x)))
        return ".json", json.dumps(scene(file))

    made = _written(draw, x, names, make)
    known = _signatures(draw, {name: scene(name) for name in names})
    return {OURS: judged([path for path, _ in made], False, [known[name] for _, name in made])}


@series(Sweep("damages of a mesh file", _COUNTS, (2.0,), 60, 600))
def meshes(draw: Draw, x: float) -> Outcomes:
    """Files of .obj, .ply (text and bytes), .stl, .off, .glb, .gltf and .3mf with bytes flipped,
    cut out or off, repeated, or replaced by hostile numbers."""
    return _damaged(draw, x, [*MESHES, "ball.gltf", "ball.3mf"], _mesh_scene)


@series(Sweep("damages of an image file", _COUNTS, (2.0,), 20, 150))
def images(draw: Draw, x: float) -> Outcomes:
    """The same of .png, .exr (also of chroma, and deep), .hdr, .pfm, .npy, .tif and .jpg, as a
    texture and as the light around."""
    return _damaged(draw, x, SOUND_IMAGES, _image_scene)

"""F6: whatever a scene, a file or a ray holds, the answer is defined.

Law.  Each hostile scene gives either one line of error (our classes; exit code 3; the file, the
place in it and what was expected or is malformed), or a picture of which every pixel that is not
finite is reported (exit code 3 too, with the places).  Never a crash, a traceback ("internal
error"), a hang (5 s of computing; 120 s in plain Python) or a pixel that is not finite and not
reported.  Each hostile ray gives a miss or a hit that is finite throughout.

Range.  `damage.NUMBERS` and its neighbours: NaN, infinities, zeros of both signs, the smallest and
largest floats, what overflows when it is squared, integers beyond 64 bits, texts, names of files
that are none, values of other types, sets of each other, cycles, anchors, tags.

Counts.  11,000 scenes and files in the full run (values 4500, structure 1600, grammar 1600, text
480, meshes 2400, images 600), rays 10^5 per magnitude.

Passes.  No failure.

How.  Scenes go to child processes (`worker`), which do as
`reference-rt render` does (8 x 8 pixels, one sample), so that one that dies takes no other with it.
Values change in a few fixed scenes (`damage`), whose compiled kernels stay the same; where they do
not, and where the structure changes (`damage`), plain Python runs the same code
(NUMBA_DISABLE_JIT=1), bit-identical and without seconds of compiling.

To reproduce a failure: its scene is in the examples as text, or else the file's bytes in base 64;
`reference-rt render scene.json -o out.exr --size 8x8 --spp 1`."""

import base64
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.experiments.fuzz.assets import MESHES, SOUND_IMAGES, files, write, write_files
from comparisons.experiments.stability.harness.core import (
    EXAMPLES,
    MITSUBA,
    OURS,
    Draw,
    Family,
    Outcome,
    Series,
    Sweep,
)
from comparisons.experiments.stability.hostile import rays
from comparisons.experiments.stability.hostile.damage import (
    BASES,
    PLAIN,
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
from reference_rt.core.diagnosis import MOST

# ---- the series ----------------------------------------------------------------------------------


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
    lines = answer.said.splitlines()
    if not 1 <= len(lines) <= MOST or not all(line.startswith("error: ") for line in lines):
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

Measure = Callable[[Draw, float], dict[str, Outcome]]


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


def values(draw: Draw, x: float) -> dict[str, Outcome]:
    made = _written(draw, x, list(BASES), _values_of)
    known = _signatures(draw, BASES)
    found = {OURS: judged([path for path, _ in made], False, [known[name] for _, name in made])}
    if draw.mitsuba:
        # The others have solids, or what Mitsuba has no twin of.
        lit = [path for path, name in made if name in ("light", "recursive")]
        found[MITSUBA] = judged_of_mitsuba(lit[: FOR_MITSUBA[draw.effort]])
    return found


def _structure_of(draw: Draw, x: float, name: str, k: int) -> tuple[str, str]:
    with deep():
        data = with_structure(draw.rng, BASES[name], int(x))
        return (".json", as_text(data)) if k % 4 else (".yaml", as_yaml(data))


def _sentence_of(draw: Draw, x: float, _: str, __: int) -> tuple[str, str]:
    return ".json", as_text(sentence(draw.rng, x, write(draw.folder)))


def _text_of(draw: Draw, x: float, name: str, k: int) -> tuple[str, bytes]:
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


def _in_plain_python(names: Sequence[str], make: Make) -> Measure:
    def measure(draw: Draw, x: float) -> dict[str, Outcome]:
        return {OURS: judged([path for path, _ in _written(draw, x, names, make)], True)}

    return measure


structure = _in_plain_python(PLAIN, _structure_of)
grammar = _in_plain_python(("",), _sentence_of)
text = _in_plain_python(PLAIN, _text_of)

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


def _of_files(names: Sequence[str], scene: Callable[[str], Any]) -> Measure:
    """Scenes that name one damaged file each."""

    def make(draw: Draw, x: float, name: str, k: int) -> tuple[str, str]:
        file = f"case{k}_{name}"
        (draw.folder / file).write_bytes(damaged(draw.rng, files()[name], int(x)))
        return ".json", json.dumps(scene(file))

    def measure(draw: Draw, x: float) -> dict[str, Outcome]:
        made = _written(draw, x, names, make)
        known = _signatures(draw, {name: scene(name) for name in names})
        return {OURS: judged([path for path, _ in made], False, [known[name] for _, name in made])}

    return measure


meshes = _of_files([*MESHES, "ball.gltf"], _mesh_scene)
images = _of_files(SOUND_IMAGES, _image_scene)

_COUNTS = (1.0, 2.0, 4.0, 8.0)

FAMILY = Family(
    "F6",
    "hostile values",
    "A hostile scene, file or ray gives one clear line of error or a defined answer, in which what "
    "is not finite is reported: no crash, no hang, no traceback.",
    (
        Series(
            "values",
            Sweep("hostile numbers in a scene", (*_COUNTS, 16.0), (1.0, 4.0), 60, 900),
            "Numbers of four sound scenes (every shape; materials and lights; recursive; layers) "
            "replaced by hostile ones.  A crash, a hang, a traceback, an unclear error or a pixel "
            "that is not finite and not reported breaks the law.",
            values,
            explained="None of this hangs on precision: what is refused is refused by rules, and "
            "Mitsuba's range of float32 is left by a single hostile number already.",
        ),
        Series(
            "structure",
            Sweep("changes of what is where", _COUNTS, (2.0,), 50, 400),
            "Values of other types, keys that are missing, new or moved, long lists, deep trees.",
            structure,
        ),
        Series(
            "grammar",
            Sweep("share of hostile values", (0.001, 0.01, 0.03, 0.1), (0.01,), 30, 400),
            "Scenes of the fuzzer, of which some numbers, names and values are hostile.",
            grammar,
        ),
        Series(
            "text",
            Sweep("damages of a scene's text", _COUNTS, (1.0,), 16, 120),
            "Bytes of YAML that are flipped, cut or repeated; tags, anchors, other documents, and "
            "aliases of aliases that stand for up to 9^24 things.",
            text,
        ),
        Series(
            "meshes",
            Sweep("damages of a mesh file", _COUNTS, (2.0,), 60, 600),
            "Files of .obj, .ply (text and bytes), .stl, .off, .glb and .gltf with bytes flipped, "
            "cut out or off, repeated, or replaced by hostile numbers.",
            meshes,
        ),
        Series(
            "images",
            Sweep("damages of an image file", _COUNTS, (2.0,), 20, 150),
            "The same of .png, .exr, .hdr, .pfm, .npy, .tif and .jpg, as a texture and as the "
            "light around.",
            images,
        ),
        *rays.SERIES,
    ),
    "Embree's tests trace NaN and infinite rays and limit their time to 2.5 times that of ordinary "
    "ones; no renderer publishes a test of hostile scenes.",
)

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
import time
from collections.abc import Callable, Mapping, Sequence
from functools import cache
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
    FloatArray,
    Outcome,
    Series,
    Sweep,
    alone,
    outcome,
)
from comparisons.experiments.stability.hostile.damage import (
    BASES,
    NUMBERS,
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
from comparisons.geometry.exact.dyadic import BoolArray
from reference_rt.core.diagnosis import MOST
from reference_rt.rendering import query
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.scene import Scene
from reference_rt.util.files import temporary_folder

# ---- hostile scenes and files --------------------------------------------------------------------


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

# ---- hostile rays to `query.intersect`: their numbers, the length of their directions, their time
#
# Law: a ray of which a number is not finite, or whose direction is 0, misses.  Any other misses or
# hits, and a hit is finite throughout, with unit normals.  t counts in units of |d|: a direction
# 2^k times as long gives 2^-k times t, bit for bit, and the rest as it was.


UNIT = 1e-12
"""How far the length of a unit normal may be from 1: some thousand roundings, of shapes that are
stretched by 10 at most."""


@cache
def _scene() -> Scene:
    """All shapes, solids and instances; its files are read at once."""

    with temporary_folder() as folder:
        write_files(folder)
        scene = Scene.parse(as_text(BASES["shapes"]), folder=folder)
        _ = scene.tables
    return scene


def ordinary(rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
    """From around the scene into it."""
    o = rng.uniform(-8.0, 8.0, (n, 3))
    return o, rng.uniform(-3.0, 3.0, (n, 3)) - o


def hostile(rng: np.random.Generator, n: int, magnitude: float) -> tuple[FloatArray, FloatArray]:
    """Ordinary ones, of which one to six numbers are hostile: of the list, or `magnitude` or its
    inverse with either sign."""
    o, d = ordinary(rng, n)
    rays = np.concatenate([o, d], axis=1)
    listed = rng.choice(np.array(NUMBERS), (n, 6))
    scaled = rng.choice([magnitude, 1.0 / magnitude], (n, 6)) * rng.choice([-1.0, 1.0], (n, 6))
    new = np.where(rng.random((n, 6)) < 0.3, listed, scaled)
    chosen = rng.random((n, 6)) < rng.uniform(0.1, 1.0, (n, 1))
    rays = np.where(chosen, new, rays)
    return np.ascontiguousarray(rays[:, :3]), np.ascontiguousarray(rays[:, 3:])


def undefined(hits: Intersections, o: FloatArray, d: FloatArray) -> BoolArray:
    """Which answers (n,) are not what the law allows."""
    met = hits.shape >= 0
    invalid = ~np.isfinite(o).all(axis=1) | ~np.isfinite(d).all(axis=1) | ~d.any(axis=1)
    wrong = np.where(met, ~(np.isfinite(hits.t) & (hits.t > 0.0)), hits.t != np.inf)
    wrong |= met & invalid
    for values in (hits.p, hits.n, hits.ns, hits.uv):
        wrong |= met & ~np.isfinite(values).all(axis=1)
    with np.errstate(all="ignore"):
        for normals in (hits.n, hits.ns):
            wrong |= met & ~(np.abs(np.linalg.norm(normals, axis=1) - 1.0) < UNIT)
    return wrong


def _judged(wrong: BoolArray, o: FloatArray, d: FloatArray, hits: Intersections) -> Outcome:
    shown = {
        "o": o,
        "d": d,
        "came": lambda k: f"t {hits.t[k]!r} shape {hits.shape[k]} n {hits.n[k].tolist()}",
        "expected": "a miss or a hit that is finite throughout",
    }
    return outcome(wrong, shown)


def numbers(draw: Draw, x: float) -> Mapping[str, Outcome]:
    o, d = hostile(draw.rng, draw.cases, x)
    hits = query.intersect(_scene().tables, o, d)
    return {OURS: _judged(undefined(hits, o, d), o, d, hits)}


def lengths(draw: Draw, x: float) -> Mapping[str, Outcome]:
    """Half of the rays with directions 2^x times as long, half 2^-x times."""
    o, d = ordinary(draw.rng, draw.cases)
    power = np.where(np.arange(len(o)) % 2 == 0, int(x), -int(x))
    scaled = np.ldexp(d, power[:, None])
    tables = _scene().tables
    once, again = query.intersect(tables, o, d), query.intersect(tables, o, scaled)
    with np.errstate(all="ignore"):
        wrong = np.ldexp(again.t, power) != once.t
        for name in ("shape", "primitive", "part", "instance", "n", "ns", "uv"):
            same = getattr(once, name) == getattr(again, name)
            wrong |= ~(same.all(axis=1) if same.ndim == 2 else same)
    return {OURS: _judged(wrong, o, scaled, again)}


MOST_TIME = 2.0
"""Times that hostile rays may take in comparison with ordinary ones."""

REPEATS = 7


def seconds(draw: Draw, _: float) -> Mapping[str, Outcome]:
    """The least of several times each, in turns: what else the machine does can only add.  Of the
    hostile rays, those that are rays: others take no time at all."""
    tables = _scene().tables
    o, d = hostile(draw.rng, 20 * draw.cases, 1.0)
    valid = np.isfinite(o).all(axis=1) & np.isfinite(d).all(axis=1) & d.any(axis=1)
    sets = [ordinary(draw.rng, draw.cases), (o[valid][: draw.cases], d[valid][: draw.cases])]
    took = np.full((REPEATS, 2), np.inf)
    for repeat in range(REPEATS):
        for k, (origins, directions) in enumerate(sets):
            if repeat == 0:
                query.first_hits(tables, origins, directions, threads=1)  # compiles
            start = time.perf_counter()
            query.first_hits(tables, origins, directions, threads=1)
            took[repeat, k] = (time.perf_counter() - start) / len(origins)
    ordinary_time, hostile_time = took.min(axis=0)
    ratio = float(hostile_time / ordinary_time)
    return {OURS: Outcome(1, int(ratio > MOST_TIME), ratio)}


OF_RAYS = (
    Series(
        "rays",
        Sweep(
            "magnitude of numbers",
            (1e0, 1e9, 1e50, 1e100, 1e150, 1e200, 1e250, 1e300),
            (1e9, 1e150, 1e300),
            20_000,
            100_000,
        ),
        "Rays in a scene of all shapes, of which one to six numbers are x, 1/x or from the list of "
        "hostile ones, NaN and infinity among them.  A hit that is not finite throughout breaks "
        "the law, and one of a ray that is none.",
        numbers,
    ),
    Series(
        "lengths",
        Sweep(
            "log2 of a direction's length",
            (8.0, 32.0, 64.0, 128.0, 256.0, 500.0, 900.0, 1000.0),
            (64.0, 500.0, 900.0),
            10_000,
            50_000,
        ),
        "Directions 2^x and 2^-x times as long: t must be 2^-x and 2^x times what it was, bit for "
        "bit, and all else the same.",
        lengths,
    ),
    Series(
        "time",
        alone(20_000, 100_000),
        "Hostile rays in comparison with ordinary ones through the same scene: no more than twice "
        "as long.",
        seconds,
        unit="times the time of ordinary rays",
    ),
)


# ---- the family ---------------------------------------------------------------------------------

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
        *OF_RAYS,
    ),
    "Embree's tests trace NaN and infinite rays and limit their time to 2.5 times that of ordinary "
    "ones; no renderer publishes a test of hostile scenes.",
)

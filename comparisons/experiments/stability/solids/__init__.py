"""F7: the laws of sets hold for CSG solids, and coincident faces leave no film.

Law.  Along each ray:
- a tree of set operations and any other that is the same set (idempotence, absorption,
  commutativity, associativity, distribution, De Morgan, complements) have the same list of
  crossings, bit for bit: the operands' crossings are the same numbers.  A - A, A - (A | B) and
  (A & B) - A have none;
- crossings of operands further apart than the sum of the widths that the query states
  (the error of the surface and of the ray's arithmetic, over the cosine) are told apart: between
  them the list says inside where exact arithmetic on the tables does.  No narrower stretch is
  reported;
- the mean of chord lengths is the volume over the area of the beam: within 4 standard errors of
  manifold3d's.

Range.  Depth 1 to 64, of spheres, ellipsoids, boxes, cylinders, cones, quadrics, tori and closed
meshes; faces shifted by 1e-3 to 2^-53 of the size, and by nothing; offsets to 1e9 sizes; 2 to 64
operands.

Counts.  2 x 10^4 rays a depth, 3000 a shift and an offset, with the exact arbiter.

Passes.  No failure.

Contestants. Ours: the query of all crossings; the textbook's: interval lists (Roth 1982), inside
tests (Tilove 1980), which give the first crossing alone. Mitsuba has no solids and takes no part:
what stands in for it elsewhere (`comparisons/mitsuba/csg.py`) is a program of this project on
Mitsuba's hits.

`trees` draws and rewrites trees; crossings and the exact truth are in
`harness.solids`."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

import reference_rt as rt
from comparisons.experiments.stability.harness import solids
from comparisons.experiments.stability.harness.core import (
    OURS,
    Draw,
    Family,
    FloatArray,
    Outcome,
    Series,
    Shot,
    Sweep,
    alone,
    hexed,
    outcome,
    pixel_grid,
    together,
)
from comparisons.experiments.stability.harness.meshes import write_smallest_ball
from comparisons.experiments.stability.harness.solids import INSIDE_TESTS, INTERVALS, LISTS, Truth
from comparisons.experiments.stability.harness.steps import at, scaled, turned, vector
from comparisons.experiments.stability.solids.trees import (
    KINDS,
    Shapes,
    Tree,
    chain,
    leaf,
    placed,
    rewritten,
)
from comparisons.geometry.affine import unit_vectors
from reference_rt.core import transform
from reference_rt.shapes.meshes.files import read_mesh
from reference_rt.util.files import temporary_folder

# What films look like: a turned box without a half of it, which has three faces in common.


PIXELS = 192

TURN = turned(-38.0, (0.4, 1.0, 0.2))

LIGHT = np.array([0.3, 0.8, 0.52])
COLOURS = np.array([[0.85, 0.45, 0.3], [0.4, 0.65, 0.85], [0.75, 0.75, 0.45]])
"""Of faces across x, y and z."""


def shoot(contestant: str, x: float) -> Shot:
    """Seen in parallel from the front, shaded by the face that the point found lies on."""
    half = (scaled(0.5, 1.0, 1.0), at(0.5 + 1.0 / x, 0.0, 0.0))
    solid = rt.Box(transform=(TURN,)) - rt.Box(transform=(*half, TURN))
    u, v = pixel_grid(PIXELS, 2.0)
    # Not along any of the box's axes, so that each pixel rounds in its own way.
    o = np.column_stack([u, v, np.full(u.size, 5.0)])
    d = np.tile([0.01, -0.02, -1.0], (len(o), 1))
    with temporary_folder() as folder:
        write_smallest_ball(folder)
        t = solids.LISTS[contestant](solid, folder, o, d)
    first = t[:, 0] if t.shape[1] else np.full(len(o), np.inf)
    pixels = _shaded(o, d, first).reshape(PIXELS, PIXELS, 3)
    caption = (
        "A turned box without its right half, whose faces lie in those of what is taken away: "
        "what is seen to the right of the cut is a film of rounding."
        if contestant != OURS
        else "The same by ours: the half is gone."
    )
    return Shot(pixels, caption)


def _shaded(o: FloatArray, d: FloatArray, t: FloatArray) -> npt.NDArray[np.uint8]:
    """8-bit sRGB (n, 3)."""
    m = transform.affine((TURN,))
    hit = np.isfinite(t)
    p = o + np.where(hit, t, 0.0)[:, None] * d
    q = transform.apply_points(transform.invert(m), p)
    off = np.concatenate([np.abs(q - 1.0), np.abs(q + 1.0), np.abs(q[:, :1])], axis=1)
    face = off.argmin(axis=1)
    axis, side = face % 3, np.where(face < 3, 1.0, np.where(face < 6, -1.0, 1.0))
    normal = m[:, :3].T[axis] * side[:, None]
    cosine = np.abs(normal @ LIGHT)
    colour = COLOURS[axis] * (0.25 + 0.75 * cosine[:, None])
    colour[~hit] = 0.12
    pixels: npt.NDArray[np.uint8] = np.round(255.0 * np.clip(colour, 0.0, 1.0)).astype(np.uint8)
    return pixels


# ---- volumes by chords against those of another kernel -------------------------------------------


BEAM = 10_000
HALF = 2.5
"""Half the side of the square beam: no operand reaches further."""

SIGMAS = 4.0
"""A right answer is further off once in 16 000 solids."""


def volumes(draw: Draw, x: float) -> Mapping[str, Outcome]:
    write_smallest_ball(draw.folder)
    off: dict[str, list[float]] = {OURS: [], solids.INTERVALS: []}
    for _ in range(draw.cases):
        shapes, tree, volume = _solid(draw, int(x))
        o = np.column_stack([draw.rng.uniform(-HALF, HALF, (BEAM, 2)), np.full(BEAM, -10.0)])
        d = np.tile([0.0, 0.0, 1.0], (BEAM, 1))
        solid = shapes.solid(tree)
        for name in off:
            t = solids.LISTS[name](solid, draw.folder, o, d)
            even = t[:, : t.shape[1] // 2 * 2]
            chords = np.where(np.isfinite(even), even, 0.0)
            length = (chords[:, 1::2] - chords[:, 0::2]).sum(axis=1) * (2.0 * HALF) ** 2
            error = max(float(length.std()) / np.sqrt(BEAM), 1e-300)
            off[name].append(abs(float(length.mean()) - volume) / error)
    return {
        name: Outcome(len(some), int(np.count_nonzero(np.array(some) > SIGMAS)), max(some))
        for name, some in off.items()
    }


def _solid(draw: Draw, operands: int) -> tuple[Shapes, Tree, float]:
    """Shapes, a tree of all, and its volume."""
    import manifold3d

    leaves, parts = [], []
    size = 1.2 * operands ** (-1.0 / 3.0)
    for k in range(operands):
        kind = ("box", "mesh")[k % 2]
        shape = leaf(draw.rng, kind, placed(draw.rng, size * (0.7 if kind == "box" else 1.0), 0.7))
        leaves.append(shape)
        parts.append(_manifold(manifold3d, draw, shape))
    tree: Tree = 0
    whole = parts[0]
    for k in range(1, operands):
        operation = str(draw.rng.choice(["|", "|", "-", "|"])) if k > 1 else "|"
        tree = (operation, tree, k)
        whole = whole + parts[k] if operation == "|" else whole - parts[k]
    return Shapes(leaves), tree, float(whole.volume())


def _manifold(manifold3d: Any, draw: Draw, shape: Any) -> Any:
    m = transform.affine(shape.transform)
    if isinstance(shape, rt.Box):
        cube = manifold3d.Manifold.cube((2.0, 2.0, 2.0), True)
        return cube.transform(m)
    data = read_mesh(draw.folder / shape.file)
    points = transform.apply_points(m, data.vertices)
    mesh = manifold3d.Mesh64(points, data.faces.astype(np.uint64))
    return manifold3d.Manifold(mesh)


# ---- the series ----------------------------------------------------------------------------------


RAYS = 250
"""Of a tree."""

LEAVES = 5
"""Different shapes of a tree: in deep ones each is there many times, in the same place."""

LAWS = 8
"""Applied to a tree, one after another."""


def rays_at(
    rng: np.random.Generator, n: int, middle: FloatArray, size: float
) -> tuple[FloatArray, FloatArray]:
    """From around, outside of everything, at points near the middle."""
    o = middle + 4.0 * size * unit_vectors(rng, n)
    return o, middle + size * rng.uniform(-1.0, 1.0, (n, 3)) - o


def pairs(rng: np.random.Generator, depth: int) -> Iterator[tuple[str, Tree, Tree | None]]:
    """Trees that are the same set; None for the empty one."""
    a, b = chain(rng, depth, LEAVES), int(rng.integers(LEAVES))
    yield "laws", a, rewritten(rng, a, LAWS, LEAVES)
    yield "A | A", a, ("|", a, a)
    yield "A & A", a, ("&", a, a)
    yield "A - A", ("-", a, a), None
    yield "A - (A | B)", ("-", a, ("|", a, b)), None
    yield "(A & B) - A", ("-", ("&", a, b), a), None


def laws(draw: Draw, x: float) -> Mapping[str, Outcome]:
    write_smallest_ball(draw.folder)
    trees = max(1, draw.cases // (6 * RAYS))
    return together(part for _ in range(trees) for part in _laws_of(draw, int(x)))


def _laws_of(draw: Draw, depth: int) -> Iterator[dict[str, Outcome]]:
    kinds = draw.rng.choice(KINDS, LEAVES, replace=False)
    shapes = Shapes([leaf(draw.rng, str(k), placed(draw.rng, 0.6, 0.7)) for k in kinds])
    o, d = rays_at(draw.rng, RAYS, np.zeros(3), 1.0)
    described = [s.model_dump_json(exclude_defaults=True) for s in shapes.leaves]
    for name, one, two in pairs(draw.rng, depth):
        shown = {"tree": repr(one)[:500], "other": repr(two)[:500], "shapes": described}
        found = {}
        for contestant in (OURS, INTERVALS):
            crossings_of = LISTS[contestant]
            a = crossings_of(shapes.solid(one), draw.folder, o, d)
            b = np.empty((len(o), 0))
            if two is not None:
                b = crossings_of(shapes.solid(two), draw.folder, o, d)
            lists = {"expected": _finite(b), "came": _finite(a)}
            rays = {"law": name, "o": o, "d": d}
            found[contestant] = outcome(~solids.same(a, b), rays | lists | shown)
        yield found


def _finite(t: FloatArray) -> Callable[[int], list[str]]:
    return lambda k: hexed(t[k][np.isfinite(t[k])])


# ---- faces that coincide, or nearly -------------------------------------------------------------


def judge(draw: Draw, solid: Any, o: FloatArray, d: FloatArray, size: float) -> dict[str, Outcome]:
    """All contestants on one solid; worst: the longest stretch that is wrong, of the size."""
    truths = solids.truths(solid, draw.folder, o, d)
    undecided = np.array([truth.touching for truth in truths])
    length = np.linalg.norm(d, axis=1) / size
    found = {}
    for contestant in (OURS, INTERVALS, INSIDE_TESTS):
        problem_of = _first if contestant == INSIDE_TESTS else solids.problem
        t = LISTS[contestant](solid, draw.folder, o, d)
        problems = [
            None if truth.touching else problem_of(truth, row)
            for truth, row in zip(truths, t, strict=True)
        ]
        wrong = np.array([problem is not None for problem in problems])
        stretches = [p[1] * float(n) for p, n in zip(problems, length, strict=True) if p]
        shown = {"o": o, "d": d, "came": _said(problems), "expected": "none"}
        shown |= {"solid": solid.model_dump_json(exclude_defaults=True)}
        found[contestant] = outcome(wrong, shown, undecided, max(stretches, default=0.0))
    return found


Problem = tuple[str, float] | None
"""What is wrong with a ray's crossings, and how long the stretch is."""


def _said(problems: Sequence[Problem]) -> Callable[[int], str]:
    return lambda k: problems[k][0]  # type: ignore[index]


def _first(truth: Truth, t: FloatArray) -> Problem:
    return solids.first_problem(truth, float(t[0]))


def coincident(rng: np.random.Generator, kind: str, shift: float, offset: float) -> Any:
    """A solid without the same one moved by `shift`, or, of a box, two that share a face but for
    `shift`: a gap, or an overlap where it is negative."""
    steps = placed(rng, 1.0, 0.0)
    away = at(*vector(offset * unit_vectors(rng, 1)[0]))
    if kind == "touching":
        beside = at(2.0 + shift, 0.0, 0.0)
        return rt.Box(transform=(*steps, away)) | rt.Box(transform=(beside, *steps, away))
    if kind == "cut":
        half = (scaled(0.5, 1.0, 1.0), at(0.5 + shift, 0.0, 0.0))
        return rt.Box(transform=(*steps, away)) - rt.Box(transform=(*half, *steps, away))
    moved = at(*vector(shift * unit_vectors(rng, 1)[0]))
    a = leaf(rng, kind, (*steps, away))
    return a - a.model_copy(update={"transform": (*a.transform[:-1], moved, away)})


SETTINGS = ("touching", "cut", *KINDS)


def _judged(draw: Draw, shift: float, offset: float, size: float) -> Mapping[str, Outcome]:
    write_smallest_ball(draw.folder)
    return together(_one(draw, kind, shift, offset, size) for kind in SETTINGS)


def _one(draw: Draw, kind: str, shift: float, offset: float, size: float) -> Mapping[str, Outcome]:
    sign = float(draw.rng.choice([-1.0, 1.0]))
    solid = coincident(draw.rng, kind, sign * shift, offset)
    scale = scaled(size)
    solid = solid.model_copy(update={"transform": (scale,)})
    middle = np.mean([_middle(part, scale) for part in solid.of], axis=0)
    o, d = rays_at(draw.rng, max(1, draw.cases // len(SETTINGS)), middle, size)
    return judge(draw, solid, o, d, size)


def _middle(part: Any, scale: Any) -> FloatArray:
    return transform.affine((*part.transform, scale))[:, 3]


def shifted(draw: Draw, x: float) -> Mapping[str, Outcome]:
    return _judged(draw, 1.0 / x, 0.0, 1.0)


def unshifted(draw: Draw, _: float) -> Mapping[str, Outcome]:
    return _judged(draw, 0.0, 0.0, 1.0)


def far(draw: Draw, x: float) -> Mapping[str, Outcome]:
    """At any size, shifted by a few roundings of the offset, or by nothing."""
    shift = float(draw.rng.choice([0.0, 1.0, 4.0])) * 2.0**-52 * x
    return _judged(draw, shift, x, float(10.0 ** draw.rng.uniform(-8.0, 8.0)))


SHIFTS = (*(float(f"1e{k}") for k in range(3, 16)), 2.0**51, 2.0**52, 2.0**53)

FAMILY = Family(
    "F7",
    "set operations",
    "Trees of set operations that are the same set have the same crossings, bit for bit; faces "
    "that coincide, or nearly, leave nothing narrower than rounding, and lose nothing wider.",
    (
        Series(
            "shift",
            Sweep("size / shift", tuple(sorted(SHIFTS)), (1e6, 1e12, 1e15), 200, 3000),
            "A solid of each kind without the same one moved by a little, two boxes that nearly "
            "touch, a box without a half of it.  What exact arithmetic tells apart must be told, "
            "and no film between crossings that rounding cannot tell apart.",
            shifted,
            unit="of the size",
            shoot=shoot,
        ),
        Series(
            "laws",
            Sweep(
                "operations in each other",
                (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0),
                (4.0, 64.0),
                1500,
                21_000,
            ),
            "Random trees of five shapes, each there many times, and others that laws of sets make "
            "of them: the lists of crossings must be the same bit for bit, and those of A - A, "
            "A - (A | B) and (A & B) - A empty.",
            laws,
        ),
        Series(
            "coincident",
            alone(200, 3000),
            "As `shift`, of nothing: the faces are parted by the rounding of the tables, or not.",
            unshifted,
            unit="of the size",
        ),
        Series(
            "offset",
            Sweep(
                "offset / size",
                (1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9),
                (1e3, 1e9),
                200,
                3000,
            ),
            "The same, of any size from 1e-8 to 1e8, away from the origin, shifted by no more than "
            "four units in the last place there.",
            far,
            unit="of the size",
        ),
        Series(
            "volume",
            Sweep("operands", (2.0, 4.0, 8.0, 16.0, 32.0, 64.0), (4.0,), 2, 8),
            "Boxes and closed meshes together and without each other: the mean length of parallel "
            "chords against the volume that manifold3d finds; more than 4 standard errors off "
            "breaks the law.",
            volumes,
            unit="standard errors",
        ),
    ),
    "POV-Ray's issues on coincident surfaces (#125, #139, #209) are open; Embree, pbrt and Mitsuba "
    "have no solids.",
)

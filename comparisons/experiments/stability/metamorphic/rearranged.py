"""The same shapes in another order, in other meshes, in groups."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness import scenes
from comparisons.experiments.stability.harness.core import OURS, Draw, Outcome, together
from comparisons.experiments.stability.harness.meshes import write_obj
from comparisons.experiments.stability.harness.steps import matrix
from comparisons.experiments.stability.metamorphic import light, rays
from comparisons.experiments.stability.metamorphic.rays import Identities
from reference_rt.core import transform

REVERSED, SHUFFLED, TRIANGLES, SPLIT = 0.0, 1.0, 2.0, 3.0


def rearranged(draw: Draw, x: float) -> dict[str, Outcome]:
    """Rays and pictures, bit for bit."""
    return together(_rearranged(draw, x))


def _rearranged(draw: Draw, x: float) -> Iterator[dict[str, Outcome]]:
    change = _reordered if x in (REVERSED, SHUFFLED) else _remeshed
    for make in (scenes.things, scenes.curves, scenes.solids):
        scene = make(draw.folder)
        bench = rays.Bench(scene, draw.cases, draw.rng, draw.mitsuba and make is scenes.things)
        other, old_names = change(scene, draw, x)
        yield bench.compared(other, bench.rays.o, bench.rays.d, old_names, exact=True)
    for make in (scenes.path, scenes.whitted):
        scene = make(draw.folder)
        other, _ = change(scene, draw, x)
        wrong = (light.colours(OURS, scene) != light.colours(OURS, other)).any(axis=-1)
        yield {OURS: Outcome(wrong.size, int(np.count_nonzero(wrong)))}


def _reordered(scene: rt.Scene, draw: Draw, x: float) -> tuple[rt.Scene, Any]:
    """Lamps keep their order: a sample picks a light by its number."""
    n = len(scene.shapes)
    order = np.arange(n)[::-1] if x == REVERSED else draw.rng.permutation(n)
    lamps = [k for k in order.tolist() if scene.shapes[k].material == "lamp"]
    order[np.isin(order, lamps)] = sorted(lamps)
    number = np.append(order, -1)

    def old_names(found: Identities) -> Identities:
        named = found.copy()
        named[:, 0] = number[found[:, 0]]
        return named

    return scene.changed(shapes=tuple(scene.shapes[k] for k in order)), old_names


def _remeshed(scene: rt.Scene, draw: Draw, x: float) -> tuple[rt.Scene, Any]:
    """Every mesh outside groups and solids with its triangles shuffled, or as two."""
    ball = scenes.ball()
    count = len(ball.faces)
    order = draw.rng.permutation(count)
    parts = [order] if x == TRIANGLES else [order[: count // 3], order[count // 3 :]]
    files = [f"part_{k}.obj" for k in range(len(parts))]
    for file, part in zip(files, parts, strict=True):
        write_obj(draw.folder / file, ball.vertices, ball.faces[part])
    shapes: list[Any] = []
    owner: list[int] = []
    primitive: list[Any] = []
    for k, shape in enumerate(scene.shapes):
        if isinstance(shape, rt.Mesh):
            shapes += [shape.model_copy(update={"file": file}) for file in files]
            primitive += parts
            owner += [k] * len(parts)
        else:
            shapes.append(shape)
            primitive.append(None)
            owner.append(k)

    def old_names(found: Identities) -> Identities:
        named = found.copy()
        for k, old in enumerate(primitive):
            rows = found[:, 0] == k
            named[rows, 0] = owner[k]
            if old is not None:
                named[rows, 3] = old[found[rows, 3]]
        return named

    return scene.changed(shapes=tuple(shapes)), old_names


# ---- groups -------------------------------------------------------------------------------------


def nested(draw: Draw, x: float) -> dict[str, Outcome]:
    """Shapes under one map, against instances of groups whose maps compose to it."""
    return together(_nested(draw, x, make) for make in (scenes.things, scenes.curves))


def _nested(draw: Draw, x: float, make: Callable[[Path], rt.Scene]) -> dict[str, Outcome]:
    scene = make(draw.folder)
    shapes = [s for s in scene.shapes if not isinstance(s, rt.Instance | rt.Plane)]
    steps = _steps(draw.rng, int(x))
    baked = tuple(s.model_copy(update={"transform": (*s.transform, *steps)}) for s in shapes)
    bare, takes_part = scene.changed(shapes=baked, groups={}), make is scenes.things
    bench = rays.Bench(bare, draw.cases, draw.rng, draw.mitsuba and takes_part)
    grouped = scene.changed(shapes=(), groups={}).changed(**_groups(shapes, steps))
    return bench.compared(grouped, bench.rays.o, bench.rays.d, _baked_names)


def _steps(rng: np.random.Generator, depth: int) -> list[transform.Matrix]:
    """Maps near the identity, no two alike."""
    found: list[transform.Matrix] = []
    for _ in range(depth):
        linear = np.eye(3) + 0.3 / depth * rng.normal(size=(3, 3))
        found += matrix(linear, 0.3 / depth * rng.normal(size=3))
    return found


def _groups(shapes: Sequence[Any], steps: Sequence[transform.Matrix]) -> dict[str, Any]:
    """Group 0 of the shapes, each further group of an instance of the one before."""
    groups: dict[str, Any] = {"0": tuple(shapes)}
    for k, step in enumerate(steps[:-1]):
        groups[str(k + 1)] = (rt.Instance(group=str(k), transform=(step,)),)
    last = rt.Instance(group=str(len(steps) - 1), transform=(steps[-1],))
    return {"groups": groups, "shapes": (last,)}


def _baked_names(found: Identities) -> Identities:
    """A shape's number in its group is its number in the scene."""
    named = found.copy()
    hit = found[:, 0] >= 0
    named[hit, 0], named[hit, 1], named[hit, 2] = found[hit, 2], -1, 0
    return named

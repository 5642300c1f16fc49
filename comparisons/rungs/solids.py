"""The rung `solids`: first hits of solids, and of primitives that enclose some space, against
raysect's.

Mitsuba has no solids, cones or tori: there its side is meshes and a plugin of ours.  raysect shares
nothing with either.  It is right but for rays that it cannot decide, such as those along a surface:
so exact arithmetic decides where the two differ, and each ray that it decides against raysect is
counted.
"""

import importlib.util
import json
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.exact.dyadic import Dyadic, nearest
from comparisons.geometry.flatten import Copy, Member, copies_of
from comparisons.mitsuba.hits import BoolArray
from comparisons.raysect import translate
from comparisons.raysect.translate import Node, node_of
from comparisons.referee.referee import Referee, crossings_of
from comparisons.referee.sizes import ShapeSizes, corners_of
from comparisons.renderers import NoCounterpartError
from comparisons.results.case import RungResult
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.rays import Rays
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.rendering import query
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables
from reference_rt.util.errors import ReferenceUnavailableError
from reference_rt.util.files import temporary_folder
from reference_rt.util.processes import tied

HOW = "raysect is not installed; to get it: pip install 'reference-rt[witness]'"

TOGETHER = 2.0**-40
"""Tolerance of t, as a fraction of the coordinates and over the cosine (see `_tolerance`), and of
normals.  Of 20,000 rays of each scene in scenes/ the worst is at 0.49 of it, and the worst ray of
the median scene at 0.0007."""

FLATTEST = 1e-3
"""Cosine below which rays are left out: raysect takes tangents for entries (its epsilon is
1e-9)."""

FEW = 1e-3
"""Largest fraction of rays that exact arithmetic may decide against raysect, far above what was
seen (4 of 20,000 in the worst scene).  More means that it was given another solid."""

MOST_JUDGED = 2_000
"""Most rays that exact arithmetic judges, evenly chosen, each in some milliseconds."""

MOST_COPIES = 4_096
"""Most copies of groups for which raysect is asked: it makes each a solid of its own."""

SECONDS = 120.0
"""Time limit of raysect: against hanging."""


class _Solids(NamedTuple):
    """scene: the scene with these shapes alone;  nodes: raysect's solids, in coordinates that
    `frame` maps the scene's to;  shape, instance: of each;  left_out: of other shapes, the
    reason."""

    scene: Scene
    nodes: list[Node]
    shape: IntArray
    instance: IntArray
    frame: affine.Affine
    left_out: dict[str, int]


def solids(scene: Scene, most: int = 20_000, seed: int = 0) -> RungResult:
    """Compare t, surface and normal of the first hits of rays through each solid, `most` in all.

    Raises SceneError.
    """
    copies = len(copies_of(scene))
    if copies > MOST_COPIES:
        reason = f"{copies} copies; raysect is asked for at most {MOST_COPIES}"
        return RungResult("solids", "not-applicable", reason)
    found = _solids_of(scene)
    told = "; ".join(f"{count} of {reason}" for reason, count in found.left_out.items())
    left_out = f"; left out: {told}" if told else ""
    if not found.nodes:
        return RungResult("solids", "not-applicable", f"no solid that raysect has{left_out}")
    if importlib.util.find_spec("raysect") is None:
        return RungResult("solids", "not-applicable", HOW)
    sizes = ShapeSizes(found.scene)
    rays = _rays(sizes, most, seed)
    ours = query.intersect(build_tables(found.scene), rays.o, rays.d)
    try:
        theirs = _traced(found, rays)
    except ReferenceUnavailableError as error:  # Mitsuba is compared all the same
        return RungResult("solids", "not-applicable", str(error))
    judged = ~_is_flat(rays, ours) & ~_is_flat(rays, theirs)
    tolerance = np.maximum(_tolerance(sizes, rays, ours), _tolerance(sizes, rays, theirs))
    same_hit, alike = _compared(sizes, ours, theirs, tolerance)
    wrong = np.flatnonzero(judged & ~(same_hit & alike))
    some = wrong[:: -(-len(wrong) // MOST_JUDGED)] if len(wrong) else wrong
    by_us, cleared, together = _decided(sizes, rays, ours, theirs, tolerance, same_hit, some)
    share = len(wrong) / max(len(some), 1)
    hits = int(np.count_nonzero(judged & (ours.shape >= 0)))
    numbers: dict[str, Any] = {
        "solids": len(found.nodes),
        "rays": len(rays.o),
        "hits": hits,
        "flat": int(np.count_nonzero(~judged)),
        "differ": len(wrong),
        "judged": len(some),
        "wrong": len(by_us),
        "cleared": len(cleared),
        "coincident": len(together),
        "left_out": found.left_out,
    }
    if len(by_us) or arbiter.too_many(round(share * len(cleared)), len(rays.o), FEW):
        first = int(by_us[0] if len(by_us) else cleared[0])
        why = (
            f"{len(by_us)} of {len(rays.o)} rays of solids are wrong by exact arithmetic"
            if len(by_us)
            else f"raysect's solids are others for {len(cleared)} of {len(rays.o)} rays, whose "
            "hits by exact arithmetic are as our tables are"
        )
        return RungResult("solids", "differ", f"{why}; {_told(rays, ours, theirs, first)}", numbers)
    text = f"{hits} hits of {len(found.nodes)} solids are raysect's"
    for count, what in ((len(cleared), "are"), (len(together), "on coincident faces are")):
        if count:
            text += f"; exact arithmetic decides {count} more for ours, which {what} not"
    return RungResult("solids", "agree", text + left_out, numbers)


def _solids_of(scene: Scene) -> _Solids:
    left_out = Counter[str]()
    some = _kept(scene, lambda copy, member: node_of(member, copy.outer), left_out)
    if not some.shapes:
        return _Solids(some, [], np.zeros(0, int), np.zeros(0, int), affine.IDENTITY, left_out)
    sizes = ShapeSizes(some)
    middle, size = 0.5 * (sizes.lower + sizes.upper), float((sizes.upper - sizes.lower).max())
    frame = np.column_stack([np.eye(3), -middle]) * (translate.SIZE / size)

    def placed(copy: Copy, member: Member) -> Node:
        return node_of(member, affine.compose(copy.outer, frame))

    some = _kept(some, lambda copy, member: translate.check(placed(copy, member)), left_out)
    all_of = [(copy, member) for copy in copies_of(some) for member in copy.members]
    return _Solids(
        some,
        [placed(*one) for one in all_of],
        np.array([copy.shape for copy, _ in all_of]),
        np.array([copy.instance for copy, _ in all_of]),
        frame,
        dict(left_out),
    )


def _kept(scene: Scene, check: Callable[[Copy, Member], object], left_out: Counter[str]) -> Scene:
    """The scene with those shapes alone for which `check` does not raise NoCounterpartError."""
    kept = dict.fromkeys(range(len(scene.shapes)))
    for copy in copies_of(scene):
        try:
            for member in copy.members if copy.shape in kept else ():
                check(copy, member)
        except NoCounterpartError as error:
            left_out[str(error)] += 1
            del kept[copy.shape]
    return scene.changed(shapes=tuple(scene.shapes[k] for k in kept))


def _rays(sizes: ShapeSizes, most: int, seed: int) -> Rays:
    """As many for each copy: half from around it to a point of its bounds, and half in a random
    direction from a point in these, which may be inside of the solid."""
    rng = np.random.default_rng(seed)
    each = -(-most // (2 * len(sizes.copies)))
    o, d = [], []
    for copy in sizes.copies:
        leaves = [leaf for leaf in sizes.leaves_of(copy) if leaf.is_finite]
        corners = np.concatenate([corners_of(leaf.bounds, copy.outer) for leaf in leaves])
        lower, upper = corners.min(axis=0), corners.max(axis=0)
        inside, towards = rng.uniform(lower, upper, (2, each, 3))
        offset = np.linalg.norm(upper - lower) * affine.unit_vectors(rng, each)
        around = 0.5 * (lower + upper) + offset
        o += [around, inside]
        d += [towards - around, affine.unit_vectors(rng, each)]
    ways = np.concatenate(d)
    return Rays(np.concatenate(o), affine.unit_rows(ways))


def _traced(found: _Solids, rays: Rays) -> Intersections:
    """raysect's hits, in scene units;  part, primitive and uv are 0.  Raises
    ReferenceUnavailableError."""
    size = 1.0 / found.frame[0, 0]
    with temporary_folder() as folder:
        given, out = folder / "rays.npz", folder / "hits.npz"
        np.savez(given, o=affine.apply_points(found.frame, rays.o), d=rays.d)
        request = {"solids": found.nodes, "rays": str(given), "out": str(out)}
        try:
            done = subprocess.run(
                [sys.executable, "-P", str(Path(translate.__file__).with_name("worker.py"))],
                input=json.dumps(request),
                capture_output=True,
                text=True,
                timeout=SECONDS,
                check=False,
                **tied(),
            )
        except subprocess.TimeoutExpired:
            raise ReferenceUnavailableError(f"raysect: no answer in {SECONDS:g} s") from None
        if done.returncode != 0:
            why = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
            raise ReferenceUnavailableError(f"raysect: {why}")
        with np.load(out) as hits:
            t, solid, normal = size * hits["t"], hits["solid"], hits["normal"]
    none, known = np.zeros(len(t), np.int32), solid >= 0
    return Intersections(
        t=t,
        shape=np.where(known, found.shape[solid], -1),
        instance=np.where(known, found.instance[solid], -1),
        part=none,
        primitive=none,
        p=np.where(known[:, None], rays.o + np.where(known, t, 0.0)[:, None] * rays.d, 0.0),
        n=normal,
        ns=normal,
        uv=np.zeros((len(t), 2)),
    )


def _is_flat(rays: Rays, hits: Intersections) -> BoolArray:
    cosine = np.abs(np.einsum("ni,ni->n", rays.d, hits.n))
    return np.asarray((hits.shape >= 0) & (cosine < FLATTEST))


def _thinnest(sizes: ShapeSizes, hits: Intersections) -> FloatArray:
    """(n,): the unit of the shape's equation, for an ellipsoid its smallest axis; infinite on
    planes."""
    bent = np.isfinite(sizes.bend_of(hits))
    return np.asarray(np.where(bent, sizes.feature_of(hits), np.inf))


def _tolerance(sizes: ShapeSizes, rays: Rays, hits: Intersections) -> FloatArray:
    """Tolerance of t (n,), 0 for a miss.  The terms of a quadratic equation are as large as the
    square of the distance in units of the shape: their rounding moves a hit by u distance² /
    feature.  raysect's coordinates are counted from the middle of all solids, and rounded there."""
    scale = np.maximum(np.abs(rays.o).max(axis=1), sizes.reach_of(hits.shape))
    scale = np.maximum(scale, scale * scale / _thinnest(sizes, hits))
    scale = np.maximum(scale, 2.0**-10 * (sizes.upper - sizes.lower).max())
    cosine = np.abs(np.einsum("ni,ni->n", rays.d, hits.n))
    tolerance = TOGETHER * scale / np.maximum(cosine, FLATTEST)
    return np.asarray(np.where(hits.shape >= 0, tolerance, 0.0))


def _compared(
    sizes: ShapeSizes, ours: Intersections, theirs: Intersections, tolerance: FloatArray
) -> tuple[BoolArray, BoolArray]:
    """Whether both have the same surface and t, or miss; whether the normals are alike."""
    same = (ours.shape == theirs.shape) & (ours.instance == theirs.instance)
    with np.errstate(invalid="ignore"):  # inf - inf of misses
        near = (ours.shape < 0) | (np.abs(ours.t - theirs.t) <= tolerance)
    turned, feature = np.linalg.norm(ours.n - theirs.n, axis=1), _thinnest(sizes, ours)
    # The curvature of an ellipsoid is up to a / b²; b is its feature, and a below its reach.
    bend = np.maximum(1.0, sizes.reach_of(ours.shape) / feature) / feature
    return np.asarray(same & near), np.asarray(turned <= TOGETHER + tolerance * bend)


def _decided(
    sizes: ShapeSizes,
    rays: Rays,
    ours: Intersections,
    theirs: Intersections,
    tolerance: FloatArray,
    same_hit: BoolArray,
    wrong: IntArray,
) -> tuple[IntArray, IntArray, IntArray]:
    """Of the rays `wrong` those whose hit or normal is wrong on our side; those that only raysect
    has wrong; those that differ where operands have a face in one place, whose order rounding
    decides."""
    differ_at = np.minimum(ours.t, theirs.t)
    copies = np.stack([sizes.copy_of(ours), sizes.copy_of(theirs)])[:, wrong]
    together = coincide(sizes, rays.rows(wrong), copies, differ_at[wrong], tolerance[wrong])
    left = wrong[~together]
    truths = Referee(sizes, TOGETHER).decide(rays.o[left], rays.d[left])
    right = [
        truth.touching or (truth.agrees(ours, k, tolerance[k]) and not same_hit[k])
        for k, truth in zip(left.tolist(), truths, strict=True)
    ]
    cleared = left[np.array(right, bool)]
    return np.setdiff1d(left, cleared), cleared, wrong[together]


def coincide(
    sizes: ShapeSizes, rays: Rays, copies: IntArray, t: FloatArray, tolerance: FloatArray
) -> BoolArray:
    """Whether two primitives of `copies` (2, n) have a face at t, within `tolerance`."""
    faces = np.zeros(len(t), np.int64)
    for number in np.unique(copies).tolist():
        rows = np.flatnonzero((copies == number).any(axis=0))
        inverse = affine.invert(sizes.copies[number].outer)
        o = affine.apply_points(inverse, rays.o[rows])
        d = affine.apply_points(inverse, rays.o[rows] + rays.d[rows]) - o
        for leaf in sizes.leaves_of(sizes.copies[number]):
            lists, _ = crossings_of(leaf, (o, d), (Dyadic.of(o), Dyadic.of(d)))
            for k, crossings in zip(rows.tolist(), lists, strict=True):
                at = nearest(np.array([c for c, _, _ in crossings], object)).astype(float)
                faces[k] += bool((np.abs(at - t[k]) <= tolerance[k]).any())
    return faces > 1


def _told(rays: Rays, ours: Intersections, theirs: Intersections, k: int) -> str:
    sides = [
        f"{whose}: shape {hits.shape[k]}, instance {hits.instance[k]}, t = {hits.t[k]:.17g}, "
        f"n = {hits.n[k].tolist()}"
        for whose, hits in (("ours", ours), ("raysect's", theirs))
    ]
    return f"the ray from {rays.o[k].tolist()} along {rays.d[k].tolist()}: {'; '.join(sides)}"

"""The vote of a third renderer without noise: first hits of all scenes, and pictures of those that
are rendered without random numbers.

It traces the rays of our grid of samples.  So each pixel has our value, but for edges on which a
sample falls to either side; and each first hit is ours, but for rays that exact arithmetic decides.
"""

import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.exact.dyadic import nearest
from comparisons.mitsuba.hits import BoolArray
from comparisons.referee.referee import Referee
from comparisons.referee.sizes import ShapeSizes
from comparisons.renderers import (
    FirstHits,
    NoCounterpartError,
    NoiseFree,
)
from comparisons.results.case import RungResult, Status
from comparisons.rungs.edges import DARK, TOLERANCE, Edges, explained_by_edges
from comparisons.rungs.footprints import is_noise_free, look_at
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.rays import Rays
from comparisons.rungs.solids import coincide
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ReferenceRtError, ReferenceUnavailableError

ROUNDINGS = 4.0
"""Tolerance of a first hit's place, in roundings of what the renderer says, over the cosine."""

FLATTEST = 1e-3
"""Least cosine in that."""

NORMAL = 2.0**-13
"""Tolerance of a normal: angles of 16 bits are off by at most 4.2e-5 (measured: 3.5e-5)."""

TOGETHER = 2.0**-40
"""Of the scene's size: faces of operands that are closer coincide."""

CUTS = 2.0
"""How often a pixel may lose a ray of the least contribution more or fewer: POV-Ray weighs rays
otherwise."""

FEW = 1e-3
"""Largest fraction of rays that exact arithmetic may decide against the witness, and of pixels that
edges may explain.  More means that it was given another scene."""

BESIDE = 8
"""Rays beside one, at whose hit rounding may decide which of two surfaces there is seen."""

FEW_COPIES = 64
"""Copies that are all asked for faces in one place: of more, only ours."""

MOST_JUDGED = 2_000
"""Most rays that exact arithmetic judges, evenly chosen."""

OURS = ("ours", "reference_rt's")
"""Whose pictures are ours."""

Pair = tuple[FloatArray, FloatArray]


class Vote(NamedTuple):
    """alone: who stands alone, empty where nobody does, or where it cannot be said."""

    status: Status
    reason: str
    numbers: dict[str, Any]
    alone: str = ""


# ---- first hits ----------------------------------------------------------------------------------


def vote_of_hits(scene: Scene, theirs: FirstHits, whose: str, threads: int | None = None) -> Vote:
    """Our first hits of a scene's camera rays, against another renderer's."""
    scene = scene.changed(shapes=tuple(scene.shapes[k] for k in theirs.shapes))
    o, d = (side.reshape(-1, 3) for side in scene.camera_rays(threads=threads))
    ours = scene.intersect(o, d, threads=threads)
    at, n = theirs.p.reshape(-1, 3), theirs.n.reshape(-1, 3)
    there, front = theirs.hit.ravel(), theirs.front.ravel()
    sizes = ShapeSizes(scene)
    is_hit, cosine = ours.shape >= 0, np.einsum("ni,ni->n", ours.n, d)
    rounding = np.append(theirs.rounding, theirs.rounding.max())[ours.shape]
    tolerance = ROUNDINGS * rounding / np.maximum(np.abs(cosine), FLATTEST)
    beyond = is_hit & ((ours.p < theirs.lower) | (ours.p > theirs.upper)).any(axis=1)
    seen = _Seen(at, n, there, front)
    same_hit, alike = seen.compared(ours, d, tolerance, sizes)
    wrong = np.flatnonzero(~(same_hit & alike) & ~beyond)
    some = wrong[:: -(-len(wrong) // MOST_JUDGED)] if len(wrong) else wrong
    at_edge = _beside(scene, seen.rows(some), (o[some], d[some]), tolerance[some], sizes)
    share, edges, some = len(wrong) / max(len(some), 1), some[at_edge], some[~at_edge]
    cleared, together = _decided(sizes, Rays(o, d), ours, seen, tolerance, same_hit, some)
    by_us = np.setdiff1d(some, np.concatenate([cleared, together]))
    hits = int(np.count_nonzero(is_hit & ~beyond)) - int(np.count_nonzero(is_hit[wrong]))
    numbers = {
        "rays": len(o),
        "hits": hits,
        "beyond": int(np.count_nonzero(beyond)),
        "differ": len(wrong),
        "at_edges": len(edges),
        "judged": len(some),
        "wrong": len(by_us),
        "cleared": len(cleared),
        "coincident": len(together),
        "left_out": theirs.left_out,
    }
    if len(by_us) or arbiter.too_many(round(share * len(cleared)), len(o), FEW):
        k = int(by_us[0] if len(by_us) else cleared[0])
        if len(by_us):
            why = f"{len(by_us)} of {len(some)} first hits that are not {whose} are wrong"
        else:
            why = f"{whose} first hits are others for {len(cleared)} of {len(o)} rays"
        x, y = k % scene.film.width, k // scene.film.width
        told = f"at x, y = ({x}, {y}) ours {ours.p[k].tolist()}, n = {ours.n[k].tolist()}"
        if there[k]:
            told += f", {whose} {at[k].tolist()}" + (f", n = {n[k].tolist()}" if front[k] else "")
        else:
            told += f", {whose} a miss"
        return Vote("differ", f"{why} by exact arithmetic; {told}", numbers)
    text = f"{hits} first hits are {whose}"
    if len(edges):
        text += f", but for {len(edges)} beside an edge"
    if len(cleared):
        text += f"; exact arithmetic decides {len(cleared)} more for ours, which are not"
    if len(together):
        text += f"; {len(together)} of {len(some)} others that were judged are on coincident faces"
    if numbers["beyond"]:
        text += f"; {numbers['beyond']} are too far to be told"
    if theirs.left_out:
        told = "; ".join(f"{count} of {reason}" for reason, count in theirs.left_out.items())
        text += f"; left out: {told}"
    return Vote("agree" if hits else "not-applicable", text, numbers)


class _Seen(NamedTuple):
    """n first hits of the witness, as `FirstHits` has them."""

    p: FloatArray
    n: FloatArray
    hit: BoolArray
    front: BoolArray

    def rows(self, some: IntArray) -> "_Seen":
        return _Seen(self.p[some], self.n[some], self.hit[some], self.front[some])

    def compared(
        self, ours: Intersections, d: FloatArray, tolerance: FloatArray, sizes: ShapeSizes
    ) -> tuple[BoolArray, BoolArray]:
        """Whether both hit the same point, or miss; whether the normals are alike."""
        is_hit = ours.shape >= 0
        near = np.linalg.norm(self.p - ours.p, axis=1) <= tolerance
        same_hit = np.where(is_hit & self.hit, near, is_hit == self.hit)
        turned = np.linalg.norm(self.n - ours.n, axis=1)
        bend = tolerance / np.maximum(sizes.bend_of(ours), tolerance)
        from_front = np.einsum("ni,ni->n", ours.n, d) < 0.0
        alike = np.where(from_front, self.front & (turned <= NORMAL + 2.0 * bend), ~self.front)
        return np.asarray(same_hit, bool), np.asarray(alike | ~is_hit, bool)


def _beside(
    scene: Scene, seen: _Seen, rays: Pair, tolerance: FloatArray, sizes: ShapeSizes
) -> BoolArray:
    """Which of the witness's hits are those of one of our rays beside, within its rounding."""
    o, d = rays
    found = np.zeros(len(o), bool)
    if not len(o):
        return found
    u = affine.unit_rows(np.cross(d, np.eye(3)[np.argmin(np.abs(d), axis=1)]))
    v = np.cross(d, u)
    for k in range(BESIDE):
        turn = 2.0 * np.pi * k / BESIDE
        step = tolerance[:, None] * (np.cos(turn) * u + np.sin(turn) * v)
        ours = scene.intersect(o + step, d)
        # The ray is moved by the tolerance, and its hit by that over the cosine.
        cosine = np.maximum(np.abs(np.einsum("ni,ni->n", ours.n, d)), FLATTEST)
        same_hit, alike = seen.compared(ours, d, 2.0 * tolerance / cosine, sizes)
        found |= same_hit & alike
    return found


def _decided(
    sizes: ShapeSizes,
    rays: Rays,
    ours: Intersections,
    seen: _Seen,
    tolerance: FloatArray,
    same_hit: BoolArray,
    wrong: IntArray,
) -> tuple[IntArray, IntArray]:
    """Of the rays `wrong` those whose hits exact arithmetic has as we have; and those whose hits
    rounding decides: exactly through an edge, or on several faces in one place."""
    if not len(wrong):
        return wrong, wrong
    truths = Referee(sizes, TOGETHER).decide(rays.o[wrong], rays.d[wrong])
    copies = sizes.copy_of(ours)[None, wrong]
    if len(sizes.copies) <= FEW_COPIES:
        copies = np.tile(np.arange(len(sizes.copies))[:, None], len(wrong))
    theirs = np.where(seen.hit, np.linalg.norm(seen.p - rays.o, axis=1), np.inf)
    first = np.minimum(ours.t, theirs)[wrong]
    open_to_both = coincide(sizes, rays.rows(wrong), copies, first, tolerance[wrong])
    exact = nearest(np.array([truth.t for truth in truths], object)).astype(float)
    hits = np.array([bool(truth.identities) for truth in truths])
    at_hand = np.abs(ours.t[wrong] - np.where(hits, exact, 0.0)) <= tolerance[wrong]
    is_hit = ours.shape[wrong] >= 0
    right = ~same_hit[wrong] & np.where(hits, is_hit & at_hand, ~is_hit)
    open_to_both |= [truth.touching or len(truth.identities) > 1 for truth in truths]
    return wrong[right & ~open_to_both], wrong[open_to_both]


# ---- pictures ------------------------------------------------------------------------------------


def vote_of_picture(
    pictures: tuple[FloatArray, FloatArray, FloatArray],
    sides: tuple[str, str, str],
    scene: Scene,
    threads: int | None = None,
) -> Vote:
    """Who of three renderers stands alone, by pixels.

    pictures: by the two sides and the witness (height, width, 3), of the same samples of `scene`;
    sides: whose they are, one of them OURS.
    """
    us = next(k for k in (0, 1) if sides[k] in OURS)
    ours, other, theirs = pictures[us], pictures[1 - us], pictures[2]
    whose, others = sides[2], sides[1 - us]
    look = look_at(scene, threads)
    assert look is not None
    least = getattr(scene.integrator, "min_contribution", 0.0)
    floor = np.maximum(
        DARK * np.abs(ours.mean(axis=(0, 1))), CUTS * least / TOLERANCE * ours.max(axis=(0, 1))
    )
    differs, explained = explained_by_edges(theirs, ours, Edges(look, floor=floor))
    wrong = differs & ~explained
    beside = _beyond(other, ours, floor), _beyond(other, theirs, floor)
    numbers = {
        "pixels": differs.size,
        "differ": int(differs.sum()),
        "on_edges": int(explained.sum()),
        "others_from_ours": beside[0],
        "others_from_witness": beside[1],
        "tolerance": TOLERANCE,
    }
    if not wrong.any() and explained.sum() <= FEW * differs.size:
        edges = f", but for {numbers['on_edges']} on edges" if numbers["on_edges"] else ""
        reason = f"{differs.size} pixels are {whose} within {100.0 * TOLERANCE:g} %{edges}"
        # At the gate the other side may sample edges otherwise, and is judged by what is ours.
        alone = others if us == 0 and min(beside) > FEW * differs.size else ""
        if alone:
            reason += f"; {alone} differ in {beside[0]}: {alone} stands alone"
        return Vote("agree", reason, numbers, alone)
    at = wrong if wrong.any() else differs
    off = np.where(at[..., None], np.abs(theirs - ours) / np.maximum(np.abs(ours), floor), -1.0)
    y, x, channel = np.unravel_index(int(np.argmax(off)), off.shape)
    found = int(at.sum())
    reason = (
        f"{found} of {differs.size} pixels are not {whose}; the worst, at x, y = ({x}, {y}): "
        f"{['red', 'green', 'blue'][channel]} {ours[y, x, channel]:.4g}, {whose} "
        f"{theirs[y, x, channel]:.4g}, {others} {other[y, x, channel]:.4g}"
    )
    alone = ""
    if beside[1] < 0.5 * min(beside[0], found):
        alone = sides[us]
        reason += f"; {others} are {whose} in all but {beside[1]}: {alone} stands alone"
    elif beside[0] < 0.5 * min(beside[1], found):
        alone = whose
        reason += f"; {others} are ours in all but {beside[0]}: {alone} stands alone"
    return Vote("differ", reason, numbers, alone)


def _beyond(a: FloatArray, b: FloatArray, floor: FloatArray) -> int:
    """Pixels that differ by more than TOLERANCE."""
    allowed = TOLERANCE * np.maximum(np.abs(b), floor)
    return int(np.count_nonzero((~(np.abs(a - b) <= allowed)).any(axis=-1)))


# ---- both ----------------------------------------------------------------------------------------


def noise_free_witness(
    witness: NoiseFree, scene: Scene, seen: Scene, threads: int | None, say: Callable[[str], None]
) -> Callable[[Pair, tuple[str, str]], tuple[RungResult, dict[str, FloatArray]]]:
    """A `comparisons.rungs.witness.Witness`.  scene: what it renders;  seen: what we do.  Raises
    ReferenceUnavailableError where it is not installed."""
    version, whose = witness.version(), f"{witness.title}'s"

    def picture_of(pair: Pair, sides: tuple[str, str]) -> tuple[Vote, FloatArray]:
        if not is_noise_free(scene):
            raise NoCounterpartError("it is random")
        if not set(sides) & set(OURS):
            raise NoCounterpartError("neither side is ours")
        with witness.load(scene, threads) as loaded:
            shown = loaded.render(1, scene.resolved_sampler.spp).pictures[0]
        pictures = (pair[0].mean(axis=0), pair[1].mean(axis=0), shown)
        return vote_of_picture(pictures, (*sides, whose), seen, threads), shown

    def hear(pair: Pair, sides: tuple[str, str]) -> tuple[RungResult, dict[str, FloatArray]]:
        start, votes, silent, shown = time.perf_counter(), {}, {}, {}
        with ThreadPoolExecutor(1) as beside:  # POV-Ray waits for most of a small picture's time
            coming = beside.submit(witness.first_hits, scene, threads)
            try:
                votes["picture"], shown[whose] = picture_of(pair, sides)
            except (NoCounterpartError, ReferenceUnavailableError) as error:
                silent["picture"] = error
            try:
                votes["first hits"] = vote_of_hits(seen, coming.result(), whose, threads)
            except (NoCounterpartError, ReferenceUnavailableError) as error:
                silent["first hits"] = error
        seconds = time.perf_counter() - start
        say(f"witness: {witness.title} ({seconds:.1f} s)")
        return _rung(votes, silent, {"version": version, "whose": whose, "seconds": seconds}), shown

    return hear


def _rung(
    votes: dict[str, Vote], silent: Mapping[str, ReferenceRtError], numbers: dict[str, Any]
) -> RungResult:
    """The rung of the votes on a scene's picture and first hits, and of why others are silent."""
    statuses = [vote.status for vote in votes.values()]
    unavailable = any(isinstance(e, ReferenceUnavailableError) for e in silent.values())
    status: Status = "not-comparable" if unavailable else "not-applicable"
    status = "agree" if "agree" in statuses and not unavailable else status
    status = "differ" if "differ" in statuses else status
    told = [
        vote.reason for vote in sorted(votes.values(), key=lambda vote: vote.status != "differ")
    ]
    told += [f"the {what} {_DO[what]} not vote: {error}" for what, error in silent.items()]
    numbers |= {what: vote.numbers for what, vote in votes.items()}
    if alone := next((vote.alone for vote in votes.values() if vote.alone), ""):
        numbers["alone"] = alone
    return RungResult("witness", status, "; ".join(told), numbers)


_DO = {"picture": "does", "first hits": "do"}

"""Two renderers, builds, back ends or versions: whether they are the same renderer.  No reference
is needed; ours may be the third, which says who is wrong.

    import comparisons

    case = comparisons.gate_pair(pictures_a, pictures_b)    # a Case: verdict, cause, write_page

Where replicate k has the same random numbers on both sides, which the correlation of the residuals
shows, the differences of pairs are judged: they see biases that are far smaller than the noise.
"""

import os
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from typing import Any

import numpy as np

from comparisons.compare import looks
from comparisons.compare.judge import Evidence, Rendered, at_look, judge, of_replicates
from comparisons.compare.looks import Looks, Pool, mean_picture
from comparisons.compare.notebook import NotebookCase
from comparisons.gate import reference
from comparisons.gate.driver import Driver
from comparisons.gate.pair_causes import cause_of
from comparisons.gate.pair_noise import FEWEST, Streams, notes_of, streams_of
from comparisons.gate.pictures_in import Picture, pictures_of
from comparisons.gate.reference import check_sizes, size_of, stacked
from comparisons.gate.rim import check_rim, left_out, without
from comparisons.gate.rounds import Rounds
from comparisons.results import LIMIT
from comparisons.results.case import Case, FloatArray, Images, RungResult
from comparisons.results.naming import named
from comparisons.rungs.input import input_rung
from comparisons.rungs.witness import Witness, vote
from comparisons.statistics import in_range
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import UsageError

ROUNDED, TINY = 1e-5, 1e-7
"""Of a value, and of the largest of a picture: what sums of some tens of float32 numbers leave
where threads add them in another order."""

SIDES = ("A's", "B's")

OURS = "reference_rt's"


@dataclass(frozen=True)
class Asked:
    """What is asked of a pair.

    limit: the smallest relative bias of the image mean that must be detectable;  name: the case's;
    scene: what both show, for the causes;  spp: samples per pixel of a picture;  judged: whether
    our pictures of the scene say who is wrong;  noise_free: there is one picture of each side, made
    without random numbers;  rim: how many of the outermost pixels are left out;  threads: ours.
    Raises UsageError.
    """

    limit: float = LIMIT
    name: str = "pair"
    scene: Scene | None = None
    spp: int | None = None
    judged: bool = False
    noise_free: bool = False
    rim: int = 0
    threads: int | None = None
    sides: tuple[str, str] = SIDES

    def __post_init__(self) -> None:
        if self.judged and self.scene is None:
            raise UsageError("our own pictures judge: expected a scene, too")


def pair_case(a: Sequence[Picture], b: Sequence[Picture], asked: Asked) -> Case:
    """The verdict on the pictures of both sides, several being replicates.  Raises ImageError,
    UsageError, SceneError."""
    check_sizes([*a, *b], *_size(asked, a[0]))
    one, two = (stacked(side) for side in (a, b))
    check_rim(one.shape, asked.rim)
    one, two = (without(side, asked.rim, 1) for side in (one, two))
    return _case(one, two, _notes(a[0], b[0], asked), asked)


def _size(asked: Asked, first: Picture) -> tuple[str, str]:
    """The size that all pictures must have, and whose it is.  first: of A."""
    if asked.scene is None:
        return size_of(first.radiance), "as A's first"
    film = asked.scene.film
    return f"{film.width} x {film.height}", f"the size of the scene '{asked.scene.name}'"


def _notes(a: Picture, b: Picture, asked: Asked) -> list[str]:
    notes = [picture.note for picture in (a, b) if picture.note]
    return [*notes, left_out(asked.rim)] if asked.rim else notes


def _case(
    one: FloatArray,
    two: FloatArray,
    notes: list[str],
    asked: Asked,
    looked: Looks | None = None,
    streams: Streams | None = None,
) -> Case:
    """The verdict on pictures without their rim, which `asked` has only for ours.  looked, streams:
    of an earlier look at a part of them."""
    exponent = in_range.exponent_of(one, two)
    if exponent:
        one, two = (in_range.times(side, exponent) for side in (one, two))
        notes.append(in_range.note(exponent))
        # What is rendered for a diagnosis has other values.
        asked = replace(asked, scene=None, judged=False)
    if asked.noise_free or (_is_fixed(one) and _is_fixed(two)):
        if not asked.noise_free:
            notes.append("each side's replicates are the same: there is no noise")
        rendered = _still(one[0], two[0])
    elif _are_copies(one, two):
        rendered = _copies(one, asked.sides)
    elif not all(np.isfinite(side).all() for side in (one, two)):
        with np.errstate(invalid="ignore"):  # of infinities
            rendered = rendered_pair(one, two, paired=False)
        rendered = replace(rendered, checked=_checked(one, two, asked.sides))
    else:
        if streams is None:
            streams = streams_of(one, two)
        one, two = _as_many(one, two) if streams.shared else (one, two)
        rendered = rendered_pair(one, two, streams.shared)
        rendered = replace(rendered, checked=_checked(one, two, asked.sides))
        notes.append(streams.words)
        if min(len(one), len(two)) > 1:
            notes += notes_of(one, two, streams.shared, asked.sides)
    evidence = Evidence(
        asked.name,
        (),
        rendered,
        seconds={},
        notes=tuple(notes),
        sides=asked.sides,
        looks=looked,
        witness=_third(asked, rendered) if asked.judged else None,
    )
    case = judge(evidence, asked.limit)
    if case.verdict != "differ" or case.images is None:
        return case
    return replace(
        case,
        cause=cause_of(case, one[0], two[0], asked.scene, asked.spp, asked.threads, asked.rim),
    )


def rendered_pair(a: FloatArray, b: FloatArray, paired: bool) -> Rendered:
    """Replicates (R, height, width, 3) of both sides, for the judge."""
    rendered = of_replicates(a, b, {})
    if not paired:
        return rendered
    error = (a - b).std(axis=0, ddof=1) / np.sqrt(len(a))
    images = replace(rendered.images, error=error, reference_error=np.zeros_like(error))
    return replace(rendered, images=images, paired=True)


def driven_pair(
    asked: Asked,
    drivers: tuple[Driver, Driver],
    rounds: Rounds,
    say: Callable[[str], None] = lambda line: None,
) -> Case:
    """The verdict on two renderers that are run in turn, with the same seeds.  Raises what
    `pair_case` and `Driver.pictures` raise."""
    sides: tuple[list[Picture], list[Picture]] = ([], [])

    expected: tuple[str, str] | None = None

    def make(count: int) -> None:
        nonlocal expected
        seeds = rounds.seeds(len(sides[0]), count)
        together = bool(seeds) and all(driver.together for driver in drivers)
        starts = [seeds] if together else [[seed] for seed in seeds]
        for start in starts:
            for side, driver in zip(sides, drivers, strict=True):
                new = driver.pictures(start)
                expected = expected or _size(asked, new[0])
                check_sizes(new, *expected)
                side += new

    make(1 if asked.noise_free or rounds.replicates == 1 else 2)
    first = [picture.radiance for side in sides for picture in side[:1]]
    check_rim(first[0].shape, asked.rim)
    bad = not all(np.isfinite(picture).all() for picture in first)
    if bad or asked.noise_free or all(_is_fixed(stacked(side)) for side in sides):
        return pair_case(*sides, asked)
    if rounds.seconds is None or rounds.replicates == 1:
        make(rounds.replicates)
        return pair_case(*sides, asked)

    most = looks.most_kept(rounds.replicates, first[0].size)
    pools = Pool(most, mean_picture), Pool(most, mean_picture)
    pooled = 0
    streams: Streams | None = None

    def grow(count: int) -> None:
        nonlocal pooled, streams
        told = pooled >= FEWEST and streams is not None
        make(count)
        for pool, side in zip(pools, sides, strict=True):
            for k in range(pooled, count):
                pool.add(without(side[k].radiance, asked.rim))
                side[k] = replace(side[k], radiance=_NONE)  # the pool has it
        pooled = count
        if not told:
            pictures = [np.stack(pool.pictures()) for pool in pools]
            exponent = in_range.exponent_of(*pictures)
            pictures = [in_range.times(side, exponent) for side in pictures]
            if all(np.isfinite(side).all() for side in pictures):
                streams = streams_of(*pictures)

    def judged_at(level: float) -> RungResult:
        one, two = (np.stack(pool.pictures()) for pool in pools)
        exponent = in_range.exponent_of(one, two)
        one, two = (in_range.times(side, exponent) for side in (one, two))
        with np.errstate(invalid="ignore"):  # of infinities, which are told
            rendered = rendered_pair(one, two, streams is not None and streams.shared)
        if _are_copies(one, two):
            rendered = _copies(one, asked.sides)
        elif level == looks.level_of(1):
            rendered = replace(rendered, checked=_checked(one, two, asked.sides))
        return at_look(rendered, asked.limit, level)

    found = looks.until_decided(
        grow, judged_at, seconds=rounds.seconds, first=max(2, rounds.replicates), most=most, say=say
    )
    one, two = (np.stack(pool.pictures()) for pool in pools)
    return _case(one, two, _notes(sides[0][0], sides[1][0], asked), asked, found, streams)


_NONE = np.zeros((0, 0, 3))


def gate_pair(
    a: Any,
    b: Any,
    *,
    scene: Scene | str | os.PathLike[str] | None = None,
    judged: bool = False,
    spp: int | None = None,
    limit: float = LIMIT,
    noise_free: bool = False,
    rim: int = 0,
    threads: int | None = None,
) -> NotebookCase:
    """Whether two renderers, builds, back ends or versions make the same pictures; no reference is
    needed, and Mitsuba takes no part.

    a, b: linear radiance of either, an array (height, width, 3) or (replicates, height, width, 3),
    or files, or a list of these, which are replicates with different seeds; replicate k of both
    with the same seed, so that random numbers that are shared are found;  scene: what they show, a
    scene or its file, for the causes;  judged: our pictures of it say who is wrong;  spp: samples
    per pixel of a replicate;  limit: the smallest relative bias of the image mean that must be
    detectable;  noise_free: they were rendered without random numbers;  rim: how many of the
    outermost pixels are left out;  threads: ours, None for all.

    The case has `verdict`, `reason`, `cause` and `write_page`.  Raises ImageError, SceneError,
    UsageError.
    """
    known = scene if scene is None or isinstance(scene, Scene) else Scene.load(os.fspath(scene))
    asked = Asked(limit, "pair" if known is None else known.name, known, spp, judged, noise_free,
                  rim, threads)  # fmt: skip
    return NotebookCase.of(pair_case(pictures_of(a), pictures_of(b), asked))


def _still(a: FloatArray, b: FloatArray) -> Rendered:
    reason = "there are no random numbers: there is no noise"
    return Rendered(Images(a, b), still=lambda: RungResult("statistics", "not-applicable", reason))


def _is_fixed(pictures: FloatArray) -> bool:
    """Whether replicates are the same, but for the rounding of float32."""
    if len(pictures) < 2 or not np.isfinite(pictures).all():
        return False
    apart = np.abs(pictures - pictures[0])
    return bool((apart <= ROUNDED * np.abs(pictures[0]) + TINY * np.abs(pictures).max()).all())


def _are_copies(a: FloatArray, b: FloatArray) -> bool:
    """Whether each picture of A is one of B, bit for bit, in any order; finite, and not black."""

    def prints(side: FloatArray) -> Counter[bytes]:  # -0 and 0 are the same radiance
        return Counter(sha256((x + 0.0).tobytes()).digest() for x in side)

    if len(a) != len(b) or not np.isfinite(a).all() or not a.any():
        return False
    return prints(a) == prints(b)


def _copies(pictures: FloatArray, sides: tuple[str, str]) -> Rendered:
    """Of sides that have the same pictures: their difference is known, and is zero, so that no
    statistics of it can say how far it might be from zero."""
    count = len(pictures)
    are = "picture is" if count == 1 else f"{count} pictures are, one by one,"
    reason = f"{sides[0]} {are} {sides[1]}, bit for bit: there is no difference"
    rendered = rendered_pair(pictures, pictures, paired=count > 1)
    same = RungResult("statistics", "unchanged", reason, {"copies": count})
    # Whether replicates are independent does not matter.
    return replace(rendered, checked=input_rung(pictures[0], pictures[0]), tested=same)


def _as_many(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    count = min(len(a), len(b))
    return a[:count], b[:count]


def _checked(a: FloatArray, b: FloatArray, sides: tuple[str, str]) -> RungResult:
    """The rung `input`, of either side beside the other's mean: sides may share noise, replicates
    of one side must not."""
    found = input_rung(a, b.mean(axis=0))
    if found.status != "agree":
        return found
    other = input_rung(b, a.mean(axis=0))
    if other.status == "agree":
        return found
    # It speaks of the second side's pictures as the candidate's.
    return replace(other, reason=named(other.reason, sides[::-1]))


def _third(asked: Asked, rendered: Rendered) -> Witness:
    """Our own pictures, which say who stands alone."""

    def hear(
        given: tuple[FloatArray, FloatArray], sides: tuple[str, str]
    ) -> tuple[RungResult, dict[str, FloatArray]]:
        assert asked.scene is not None
        ours = reference.of_scene(asked.scene, asked.limit, threads=asked.threads)
        pictures = without(ours.pictures, asked.rim, 1)
        shown = {OURS: pictures.mean(axis=0)}
        if (
            rendered.replicates is None
            or ours.noise_free
            or pictures.shape[1:] != given[0].shape[1:]
        ):
            reason = "our pictures do not vote on pictures without noise, or of another size"
            return RungResult("witness", "not-applicable", reason), shown
        one, two = rendered.replicates
        assert isinstance(two, np.ndarray)
        known = None
        if rendered.tested is not None:
            known = replace(rendered.tested, status="agree")
        elif rendered.paired:
            known = at_look(replace(rendered, checked=None), asked.limit, 1.0)
        rung = vote((one, two, pictures), (*sides, OURS), asked.limit, known)
        return rung, shown

    return hear

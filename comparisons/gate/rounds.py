"""The gate of a renderer that it drives: replicates are added until the question is decided."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from comparisons.compare import looks
from comparisons.gate.copies import Copies
from comparisons.gate.driver import Driver
from comparisons.gate.gate import first_fault, look, unchanged
from comparisons.gate.pictures_in import Picture
from comparisons.gate.reference import Reference, check_sizes, size_of
from comparisons.gate.request import Judge, Request, prepared
from comparisons.results.case import Case, RungResult
from reference_rt.rendering.render import Progress

STRIDE = 1_327_217_885
"""From one seed to the next, modulo SEEDS: their golden section, so that no two seeds of n are
nearer than about SEEDS / (2.24 n) (the three-gap theorem), and odd, so that none occurs twice.
Small renderers seed a pixel by the seed plus its number: nearby seeds make copies that are moved.
"""

SEEDS = 1 << 31
"""Seeds are below it, for renderers that read a signed number of 32 bits."""


@dataclass(frozen=True)
class Rounds:
    """seed: of the first replicate; those of the others are far from it;  replicates: of the first
    look, or all if they are fixed;  seconds: time limit, after which no replicates are added; None:
    `replicates` are fixed."""

    seed: int = 1
    replicates: int = looks.FIRST
    seconds: float | None = looks.SECONDS

    def seeds(self, begin: int, end: int) -> list[int]:
        """Of the replicates from `begin` to `end`, counted from 0."""
        return [(self.seed + k * STRIDE) % SEEDS if k else self.seed for k in range(begin, end)]


def gated_renderer(
    request: Request,
    driver: Driver,
    rounds: Rounds,
    say: Callable[[str], None] = lambda line: None,
    progress: Progress = lambda what, fraction: None,
) -> Case:
    """The verdict on a renderer.  say: is told of each look;  progress: of the reference's.

    Each replicate is checked before others are rendered, unless one start of the renderer makes
    all. A reference of one picture, and one without noise, need no looks.  Raises what
    `gated` and `Driver.pictures` raise.
    """
    at_once = rounds.replicates if driver.together else 1
    pictures = driver.pictures(rounds.seeds(0, at_once))
    judge = prepared(request, pictures, progress)
    reference = judge.reference
    check_sizes(pictures, size_of(reference.pictures[0]), "as the reference")
    if first_fault(pictures[0], reference) is not None and not _is_copy(pictures[0], reference):
        return judge.case(pictures)
    try:
        return _in_rounds(judge, driver, rounds, pictures, say)
    except _NotFiniteError as error:
        bad = error.picture
        notes = [f"{bad.name} is the first with such pixels: no others were made after it"]
        return judge.case([bad], notes)


def _in_rounds(
    judge: Judge,
    driver: Driver,
    rounds: Rounds,
    pictures: list[Picture],
    say: Callable[[str], None],
) -> Case:
    """The verdict; `pictures` are those that were made.  Raises _NotFiniteError."""
    request, reference = judge.request, judge.reference
    one_picture = reference.variance is None and len(reference.pictures) == 1
    if rounds.seconds is None or rounds.replicates == 1 or reference.noise_free or one_picture:
        pictures += _rendered(driver, rounds.seeds(len(pictures), rounds.replicates), reference)
        return judge.case(pictures)

    size = reference.pictures[0].size
    most = looks.most_kept(rounds.replicates, size)
    copies = Copies.of(reference.fingerprints)
    pool = looks.Pool(most, _mean)
    made = 0

    def grow(count: int) -> None:
        nonlocal made
        new = pictures if made == 0 else []
        new += _rendered(driver, rounds.seeds(made + len(new), count), reference)
        for picture in copies.others(new):
            pool.add(picture)
        made = count

    def judged_at(level: float) -> RungResult:
        others = pool.pictures()
        if not others:
            return RungResult("statistics", "unchanged", copies.words)
        if len(others) == 1:
            reason = "all candidates but one are copies of the reference's pictures"
            return RungResult("statistics", "inconclusive", reason)
        return look(others, reference, request.limit, level, request.rim)

    looked = looks.until_decided(
        grow,
        judged_at,
        seconds=rounds.seconds,
        first=rounds.replicates,
        most=most,
        say=say,
    )
    others = pool.pictures()
    if not others:
        return unchanged(request.name, copies, reference)
    notes = [copies.note(len(others))] if copies.count else []
    return judge.case(others, notes, looked)


class _NotFiniteError(Exception):
    """A picture that was made has pixels that are not finite."""

    def __init__(self, picture: Picture) -> None:
        super().__init__(picture.name)
        self.picture = picture


def _rendered(driver: Driver, seeds: Sequence[int], reference: Reference) -> list[Picture]:
    """Pictures of the reference's size, each checked before the next is made.  Raises ImageError
    for another size, _NotFiniteError."""
    pictures: list[Picture] = []
    for start in [seeds] if driver.together else [[seed] for seed in seeds]:
        new = driver.pictures(start) if start else []
        if new:
            check_sizes(new, size_of(reference.pictures[0]), "as the reference")
        for picture in new:
            if not np.isfinite(picture.radiance).all():
                raise _NotFiniteError(picture)
        pictures += new
    return pictures


def _is_copy(picture: Picture, reference: Reference) -> bool:
    return not Copies.of(reference.fingerprints).others([picture])


def _mean(pictures: Sequence[Picture]) -> Picture:
    """The mean of replicates, for those that are averaged to save memory."""
    first = pictures[0]
    opacities = [p.opacity for p in pictures if p.opacity is not None]
    return Picture(
        np.asarray(np.mean([p.radiance for p in pictures], axis=0)),
        np.asarray(np.mean(opacities, axis=0)) if opacities else None,
        quantised=any(p.quantised for p in pictures),
        displayed=any(p.displayed for p in pictures),
        name=first.name,
        header=first.header,
    )

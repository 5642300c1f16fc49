"""The loop: a smaller scene is kept if it still fails."""

import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

from comparisons.experiments.fuzz.data import Data, text_of
from comparisons.experiments.fuzz.reduce.edits import EDITS, Edit, without_unused
from comparisons.experiments.fuzz.reduce.numbers import simpler_numbers, smaller_pictures

Fails = Callable[[Data], bool]
"""Whether a scene fails in the same rung with the same cause."""

_EDITS: tuple[Edit, ...] = (*EDITS, smaller_pictures, simpler_numbers)


class Found(NamedTuple):
    """scene: the smallest that fails;  tried: scenes that were checked;  done: whether no
    edit makes it smaller, not only time or tries were used up."""

    scene: Data
    tried: int
    done: bool


def reduce(
    scene: Data,
    fails: Fails,
    *,
    most: int = 600,
    seconds: float = 120.0,
    clock: Callable[[], float] = time.monotonic,
) -> Found:
    """The smallest scene that is found with at most `most` tries and in about `seconds`."""
    end, tried = clock() + seconds, 0
    seen = {text_of(scene)}

    def still(candidate: Data) -> bool:
        nonlocal tried
        text = text_of(candidate)
        if text in seen:
            return False
        seen.add(text)
        tried += 1
        return fails(candidate)

    def enough() -> bool:
        return tried >= most or clock() > end

    tidy = without_unused(scene)
    if still(tidy):
        scene = tidy
    while True:
        before = text_of(scene)
        for edit in _EDITS:
            scene = _with_edit(scene, edit, still, enough)
        if enough():
            return Found(scene, tried, False)
        if text_of(scene) == before:
            return Found(scene, tried, True)


def _with_edit(
    scene: Data, edit: Edit, still: Callable[[Data], bool], enough: Callable[[], bool]
) -> Data:
    """The scene after all steps of an edit that leave it failing.  After a success the edit goes on
    at the same place of the smaller scene: what failed to go before rarely goes now."""
    place = 0
    while not enough():
        found = None
        for k, candidate in enumerate(_from(edit(scene), place)):
            if enough():
                return scene
            candidate = without_unused(candidate)
            if still(candidate):
                found, place = candidate, place + k
                break
        if found is None:
            return scene
        scene = found
    return scene


def _from(candidates: Iterator[Data], place: int) -> Iterator[Data]:
    for k, candidate in enumerate(candidates):
        if k >= place:
            yield candidate

"""The picture that grows above a terminal's bar while `render` computes it."""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager

from reference_rt.cli.pictured import Pictured, PicturedLine
from reference_rt.cli.terminal_picture import Pixels
from reference_rt.jit.parallel_compile import Report
from reference_rt.rendering.first_look import FirstLook
from reference_rt.rendering.image import display, eight_bits
from reference_rt.rendering.picture import Picture
from reference_rt.scene.build import BuiltScene

_BETWEEN, _SHARE = 0.5, 20.0
"""Seconds between two pictures at least; their part of the time is at most one in so many."""


def pixels_of(picture: Picture) -> Pixels:
    """The picture as the command `render` would write it to a .png file."""
    return eight_bits(display(picture))


@contextmanager
def first_look(scene: BuiltScene, progress: PicturedLine) -> Iterator[Report]:
    """What is to be told of compiling: it moves the bar, and on a terminal a first picture of the
    scene is above it."""
    if not progress.draws:
        yield progress.compiling
        return
    with FirstLook(scene, lambda pixels: progress.show_pictures([("", pixels)])) as look:

        def compiling(done: int, total: int) -> None:
            progress.compiling(done, total)
            look.compiling(done, total)

        yield compiling


class Growing:
    """Shows the picture so far above a bar, now and then."""

    def __init__(self, bar: Pictured) -> None:
        self._bar = bar
        self._due = time.monotonic() + _BETWEEN if bar.draws else math.inf

    @property
    def is_due(self) -> bool:
        """Whether it is time for another picture."""
        return time.monotonic() >= self._due

    def show(self, picture: Picture, began: float) -> None:
        """began: when the picture was asked for, of `time.monotonic`."""
        self._bar.show_pictures([("", pixels_of(picture))])
        now = time.monotonic()
        self._due = now + max(_BETWEEN, _SHARE * (now - began))

"""Other renderers: what each must provide, and which there are.

Contract: a `Renderer` says its version, and translates and loads a scene; what it loaded renders
replicates.  The commands truth and converge and the option --witness need no more.  To add one: a
folder of `comparisons` with a module that has such a `RENDERER`, its place in `PLACES`, and its
name in `WitnessName` and `comparisons.commands.options.Witness` if it may vote.
"""

import importlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from typing import Literal, NamedTuple, Protocol, cast, get_args, runtime_checkable

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ReferenceRtError, UsageError

BoolArray = npt.NDArray[np.bool_]


class Replicates(NamedTuple):
    """Independent pictures (replicates, height, width, 3) of linear radiance, row 0 on top; the
    wall-clock seconds (replicates,) of each; and the samples per pixel that they really have."""

    pictures: FloatArray
    seconds: FloatArray
    spp: int


class NoCounterpartError(ReferenceRtError):
    """A part of a scene that another renderer does not compute, or computes otherwise: the scene is
    `not-comparable`.  The exit code is the same as if that renderer could not run."""

    exit_code = 4


class Reasons(list[str]):
    """Why another renderer is not eligible for a scene: all reasons, each once."""

    @contextmanager
    def collected(self) -> Iterator[None]:
        """Keeps the reason of a NoCounterpartError, so that the others are found, too."""
        try:
            yield
        except NoCounterpartError as error:
            if str(error) not in self:
                self.append(str(error))

    def check(self) -> None:
        """Raises NoCounterpartError with all reasons, if there are any."""
        if self:
            raise NoCounterpartError("; ".join(self))


class Loaded(Protocol):
    """A scene that another renderer has loaded."""

    def render(
        self, count: int, spp: int, seed: int = 0, say: Callable[[str], None] = lambda line: None
    ) -> Replicates:
        """Pictures with the seeds seed, seed + 1, ...; the first one's seconds may have compiling
        in them.  say: called with each line that the renderer prints.  Raises
        ReferenceUnavailableError if the renderer refuses, crashes or hangs."""


class Renderer(Protocol):
    """Another renderer."""

    @property
    def title(self) -> str:
        """Its name, for people."""

    def version(self) -> str:
        """Version and variant, for provenance.  Raises ReferenceUnavailableError, which says how to
        get the renderer, if it is not installed."""

    def load(self, scene: Scene, threads: int | None = None) -> AbstractContextManager[Loaded]:
        """Translate a scene and load it; after the context nothing of it is left.  threads: None
        for all cores.  Raises NoCounterpartError with all reasons, ReferenceUnavailableError,
        SceneError for a file that cannot be used."""


class FirstHits(NamedTuple):
    """What the pixels' centres show, in scene units.

    shapes: the indices of those that the renderer has, and traced;  p, n (height, width, 3):
    points, and unit normals of those on a front;  hit, front (height, width): whether there is one,
    and whether it is on its surface's front;  left_out: of other shapes the reason, and how many;
    rounding (shapes,): of
    the coordinates on each;  lower, upper (3,): coordinates beyond cannot be told.
    """

    shapes: tuple[int, ...]
    p: FloatArray
    n: FloatArray
    hit: BoolArray
    front: BoolArray
    left_out: dict[str, int]
    rounding: FloatArray
    lower: FloatArray
    upper: FloatArray


@runtime_checkable
class NoiseFree(Renderer, Protocol):
    """Another renderer that draws no random numbers, and traces the rays of our grid."""

    def first_hits(self, scene: Scene, threads: int | None = None) -> FirstHits:
        """Of the scene's camera rays.  Raises NoCounterpartError, ReferenceUnavailableError."""


PLACES = {
    "mitsuba": "comparisons.translator.native",
    "cycles": "comparisons.cycles.backend",
    "povray": "comparisons.povray.backend",
}
"""The modules of the other renderers, by name.  Imported when one is needed."""

ReferenceSampler = Literal["independent", "multijitter"]
"""Mitsuba's samplers of a comparison, see `comparisons.compare.budget`."""

WitnessName = Literal["cycles", "povray"]
"""Those that are no party to a comparison, and may be asked who is right."""


def other(name: str) -> Renderer:
    """The renderer with a name of PLACES."""
    return cast(Renderer, importlib.import_module(PLACES[name]).RENDERER)


Witnesses = str | Sequence[str] | None
"""One `WitnessName`, several or none."""


def several(given: Witnesses) -> tuple[WitnessName, ...]:
    """The witnesses, once each.  Raises UsageError for a name that is none of theirs."""
    names = dict.fromkeys([given] if isinstance(given, str) else given or ())
    if unknown := [name for name in names if name not in get_args(WitnessName)]:
        expected = " or ".join(get_args(WitnessName))
        raise UsageError(f"witness: expected {expected}, got '{unknown[0]}'")
    return cast(tuple[WitnessName, ...], tuple(names))


def witness_facts(given: Witnesses) -> dict[str, str]:
    """The witnesses' versions and variants, for provenance.  Raises ReferenceUnavailableError if
    one is not installed."""
    return {name: other(name).version() for name in several(given)}

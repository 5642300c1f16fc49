"""The methods under test, our renderer and Mitsuba's variants with one sampler each; and their
ladder: plans the rungs, renders and stores the replicates of each; the methods take turns."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Protocol, Self

import numpy as np

from comparisons.experiments.convergence.estimates import Accumulator, against
from comparisons.experiments.convergence.store import (
    FIRST,
    Reference,
    Rung,
    Settings,
    Store,
)
from comparisons.integrators import from_other_end
from comparisons.mitsuba.backend import LLVM, SCALAR
from comparisons.renderers import NoCounterpartError, other
from comparisons.renderers import Renderer as Other
from comparisons.runs.elsewhere import cool_down
from comparisons.translator.native import Native
from comparisons.translator.notes import notes_of
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.render import Progress, render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Independent, Sobol
from reference_rt.util.errors import ReferenceUnavailableError, SceneError, UsageError


class Shot(NamedTuple):
    """A picture (height, width, 3), its actual samples per pixel, and the seconds from the call to
    the array."""

    picture: FloatArray
    spp: int
    seconds: float


class Renderer(Protocol):
    """A method that is ready to render."""

    def __call__(self, spp: int, replicate: int) -> Shot:
        """A picture of about `spp` samples per pixel; different replicates are independent."""


BEST = "best"
"""Placeholder for the best sampler, which a trial determines."""


@dataclass(frozen=True)
class Method:
    """name: for files and options;  title: for people;  sampler: its name, or BEST;  side: "ours",
    CYCLES, or the Mitsuba variant, methods of which share what is loaded;  from_other_end:
    by particles from the lamps, and where the scene has these by paths from the camera."""

    name: str
    title: str
    sampler: str
    side: str
    from_other_end: bool = False

    @property
    def is_independent(self) -> bool:
        """Whether samples are independent of each other; squared errors then fall as 1 / n."""
        return self.sampler == "independent"

    @property
    def factor(self) -> int:
        """The ratio of samples between one rung and the next.

        4 for samplers that round other numbers up: multijitter takes 35 for 32, which is not a
        power of two, and a third longer per sample (measured); ldsampler takes 64.
        """
        return 4 if self.sampler in ("multijitter", "ldsampler") else 2


def with_sampler(method: Method, sampler: str) -> Method:
    """The same side of Mitsuba with its best sampler, which is this one."""
    title = method.title.partition(",")[0]
    return replace(method, sampler=sampler, title=f"{title}, {sampler} (best)")


CYCLES = "cycles"

METHODS = (
    Method("ours", "ours, Sobol' (default and best)", "sobol", "ours"),
    Method("ours_independent", "ours, independent", "independent", "ours"),
    Method("mitsuba_llvm", "Mitsuba llvm, independent (default)", "independent", LLVM),
    Method("mitsuba_llvm_best", "Mitsuba llvm, its best sampler", BEST, LLVM),
    Method("mitsuba_scalar", "Mitsuba scalar, independent (default)", "independent", SCALAR),
    Method("mitsuba_scalar_best", "Mitsuba scalar, its best sampler", BEST, SCALAR),
    Method("cycles", "Cycles, Sobol' (default)", "sobol", CYCLES),
    Method("ours_other_end", "ours, from the other end", "sobol", "ours", from_other_end=True),
)

NAMES = tuple(method.name for method in METHODS)


def chosen(only: tuple[str, ...]) -> tuple[Method, ...]:
    """The methods with these names, all if there are none.  Raises UsageError for unknown names."""
    if unknown := [name for name in only if name not in NAMES]:
        raise UsageError(f"--only: expected some of {', '.join(NAMES)}, got '{unknown[0]}'")
    return tuple(c for c in METHODS if not only or c.name in only)


class AbsentError(Exception):
    """A method cannot render the scene; the message says why."""


@contextmanager
def _absent() -> Iterator[None]:
    """Turn what another renderer raises into AbsentError: a method that fails must not stop the
    others."""
    try:
        yield
    except (NoCounterpartError, ReferenceUnavailableError) as error:
        raise AbsentError(str(error)) from None


def remarks(scene: Scene) -> list[str]:
    """Notes about Mitsuba's pictures of the scene, for the reader."""
    notes = ["Mitsuba traces with Embree's robust flag, without which rays leak between triangles"]
    if notes_of(scene):
        notes.append(
            "Mitsuba renders with its own materials and their approximations, which `compare` "
            "replaces: they contribute to its bias"
        )
    return notes


class Stable:
    """Prepares methods and keeps what they share.  A context manager: at its end nothing is loaded,
    and Mitsuba is in the variant that it was in."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._loaded = ExitStack()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._loaded.close()

    def ready(self, method: Method, progress: Progress | None = None) -> Renderer:
        """Load and compile.  Raises SceneError, AbsentError."""
        if method.from_other_end:
            with _absent():
                return self._from_other_end(method, progress)
        if method.side == "ours":
            return self._ours(self._scene, method, progress)
        renderer: Other = (
            other(CYCLES) if method.side == CYCLES else Native(method.side, method.sampler)
        )
        with _absent():
            loaded = self._loaded.enter_context(renderer.load(self._scene))

        def shot(spp: int, replicate: int) -> Shot:
            cool_down()
            with _absent():
                found = loaded.render(1, spp, seed_of(replicate))
            return Shot(found.pictures[0], found.spp, float(found.seconds[0]))

        return shot

    def _from_other_end(self, method: Method, progress: Progress | None) -> Renderer:
        scene = self._scene
        try:
            other = scene.changed(integrator=from_other_end(scene))
            return self._ours(other, method, progress)
        except SceneError as error:
            raise AbsentError(error.message) from None

    def _ours(self, scene: Scene, method: Method, progress: Progress | None) -> Renderer:
        make: Callable[..., Sobol | Independent]
        make = Sobol if method.sampler == "sobol" else Independent
        tables = self._scene.tables
        # Far from the seeds that users choose, and from those of the reference.
        first = FIRST_SEED if method.sampler == "sobol" else 2 * FIRST_SEED

        def shot(spp: int, replicate: int) -> Shot:
            seeded = scene.changed(sampler=make(spp=spp, seed=first + replicate))
            cool_down()
            start = time.perf_counter()
            picture = render(seeded, tables=tables).colour
            return Shot(picture, spp, time.perf_counter() - start)

        small = scene.changed(sampler=make(spp=FIRST, seed=first))
        render(small, tables=tables, progress=progress)  # compile
        return shot


FIRST_SEED = 1 << 40


def seed_of(replicate: int) -> int:
    """Mitsuba's 32-bit seeds, spread as multiples of the golden ratio: it adds the pixel index to
    the seed, so that close seeds would give different pixels the same random numbers."""
    return (1 + replicate) * 0x9E3779B1 % (1 << 32)


# ---- the plan -----------------------------------------------------------------------------------


TRIALS = (FIRST, 4 * FIRST)
"""Samples a pixel of the pictures that costs are estimated from."""

TRIAL_SEED = 1 << 20
"""Replicate number of these pictures, above all that count."""

MOST_SAMPLES = (1 << 32) - 1
"""Of one picture: Mitsuba numbers them with 32 bits."""


@dataclass(frozen=True)
class Cost:
    """Seconds of a picture: start + per_sample * samples per pixel."""

    start: float
    per_sample: float

    def picture(self, spp: int) -> float:
        return self.start + self.per_sample * spp

    def rung(self, spp: int, replicates: int) -> float:
        return replicates * self.picture(spp)


def estimate(renderer: Renderer) -> Cost:
    """From three pictures each with two numbers of samples: the first of the three may compile, and
    the fastest other is what was disturbed least."""
    found = []
    for spp in TRIALS:
        shots = [renderer(spp, TRIAL_SEED + k) for k in range(3)]
        found.append((shots[0].spp, min(shot.seconds for shot in shots[1:])))
    (few, short), (many, long) = found
    # Where noise hides the difference, all of the longer one counts as samples.
    per_sample = (long - short) / (many - few) if long > short else long / many
    return Cost(max(0.0, short - per_sample * few), per_sample)


def rungs(max_spp: int, factor: int = 2) -> tuple[int, ...]:
    """FIRST, `factor` times that, ... up to `max_spp`."""
    found = []
    spp = FIRST
    while spp <= max_spp:
        found.append(spp)
        spp *= factor
    return tuple(found)


def affordable(
    cost: Cost, seconds: float, settings: Settings, pixels: int, factor: int = 2
) -> tuple[int, ...]:
    """The rungs that fit into `seconds`, the cheapest first."""
    found: list[int] = []
    for spp in rungs(settings.max_spp, factor):
        seconds -= cost.rung(spp, settings.replicates)
        if seconds < 0.0 or spp * pixels > MOST_SAMPLES:
            break
        found.append(spp)
    return tuple(found)


def why_left_out(
    cost: Cost,
    planned: Sequence[int],
    share: float,
    settings: Settings,
    pixels: int,
    factor: int = 2,
) -> str:
    """Why the rung after the last planned one is not rendered; "" if it is above max_spp."""
    following = [spp for spp in rungs(settings.max_spp, factor) if spp not in planned]
    if not following:
        return ""
    spp = following[0]
    if spp * pixels > MOST_SAMPLES:
        return f"rungs from {spp} samples per pixel: over {MOST_SAMPLES:,} samples in a picture"
    spent = sum(cost.rung(done, settings.replicates) for done in planned)
    return (
        f"rungs from {spp} samples per pixel: {settings.replicates} pictures would take "
        f"{cost.rung(spp, settings.replicates):.2g} s, and {max(0.0, share - spent):.2g} s of its "
        f"{share:.2g} s are left"
    )


# ---- the ladder ---------------------------------------------------------------------------------


PATIENCE = 1.5
"""A method may take this many times its share of the time, if its trial was too fast."""

STORED_EVERY = 15.0
"""Seconds of work that a kill can lose.  Ctrl-C loses no finished picture."""


@dataclass
class Climb:
    """One method on the ladder.

    renderer: prepares it when first needed;  planned: its rungs;  share: its seconds;  apart:
    whether its turn comes after the others' rungs, because switching to it takes time;  gathered:
    replicates so far, by requested samples;  stopped: why rungs were given up;  failed: why it has
    no rungs at all.
    """

    renderer: Callable[[], Renderer]
    planned: Sequence[int]
    share: float
    apart: bool = False
    gathered: dict[int, Accumulator] = field(default_factory=dict)
    stopped: str = ""
    failed: str = ""

    @property
    def rungs(self) -> list[Rung]:
        """The rungs with at least one replicate, the lowest first."""
        return [self.gathered[spp].rung() for spp in self.planned if self.gathered[spp].count]

    def add(self, spp: int, replicate: int) -> None:
        """Render one more picture.  A method that fails, or whose picture is not finite, loses all
        its rungs."""
        try:
            shot = self.renderer()(spp, replicate)
        except AbsentError as error:
            self.failed = str(error)
        else:
            bad = np.count_nonzero(~np.isfinite(shot.picture).all(axis=-1))
            if not bad:
                self.gathered[spp].add(*shot)
                return
            self.failed = f"{bad} pixels of a picture of {spp} samples per pixel are not finite"
        self.planned = ()

    def shorten(self, replicates: int) -> None:
        """Give up the highest rungs if all replicates would take more than PATIENCE times the
        share, as extrapolated from those so far; two rungs stay, the minimum for a curve."""
        rungs = {spp: self.gathered[spp].rung() for spp in self.planned}
        taking = {spp: replicates * float(rung.warm.mean()) for spp, rung in rungs.items()}
        while len(taking) > 2 and sum(taking.values()) > PATIENCE * self.share:
            highest = max(taking)
            if self.gathered[highest].count >= replicates:
                break
            self.stopped = (
                f"rungs from {highest} samples per pixel: slower than in the trial, "
                f"{sum(taking.values()):.2g} s in total, of a share of {self.share:.2g} s"
            )
            del taking[highest]
        self.planned = list(taking)


def climb(
    climbs: Mapping[str, Climb],
    reference: Reference,
    replicates: int,
    store: Store,
    say: Progress = lambda what, fraction: None,
) -> None:
    """Render what is planned and not stored, in sweeps: one picture of every rung of every method,
    then the next of each.

    Each rung's pictures are thus spread over the whole run: a disturbance of the machine affects
    all methods alike, and no rung's median.  Pictures are stored, after an interruption too.
    """
    for name, one in climbs.items():
        for spp in one.planned:
            done = store.rung(name, spp)
            one.gathered[spp] = Accumulator(spp, reference, done and against(done, reference))
    stored = time.monotonic()
    changed: set[tuple[str, int]] = set()

    def keep() -> None:
        for name, spp in sorted(changed):
            if not climbs[name].failed:
                store.keep(name, climbs[name].gathered[spp].rung())
        changed.clear()

    say("ladder", 0.0)
    try:
        for k in range(replicates):
            sweep = _sweep(climbs)
            samples, all_samples = 0, sum(spp for _, spp in sweep)
            for name, spp in sweep:
                one = climbs[name]
                if one.gathered[spp].count <= k and not one.failed:
                    # No two rungs share replicate numbers, and hence seeds.
                    one.add(spp, spp * replicates + k)
                    changed.add((name, spp))
                samples += spp
                say("ladder", (k + samples / all_samples) / replicates)
            if time.monotonic() - stored > STORED_EVERY:
                keep()
                stored = time.monotonic()
            if k == 1:
                for one in climbs.values():
                    one.shorten(replicates)
    except KeyboardInterrupt:
        with suppress(KeyboardInterrupt):
            keep()
        raise
    keep()


def _sweep(climbs: Mapping[str, Climb]) -> list[tuple[str, int]]:
    """(method, samples): rung by rung, methods in turn."""
    pairs = [(name, spp) for name, one in climbs.items() for spp in one.planned]
    return sorted(pairs, key=lambda pair: (climbs[pair[0]].apart, pair[1]))

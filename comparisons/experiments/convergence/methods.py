"""The methods under test: our renderer and Mitsuba's variants, each with one sampler."""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol, Self

import numpy as np

from comparisons.geometry.flatten import copies_of
from comparisons.mitsuba.backend import LLVM, SCALAR, backend, mitsuba, variant
from comparisons.mitsuba.notes import notes_of
from comparisons.mitsuba.translate import MOST_INSTANCES, UntranslatableError, to_mitsuba
from comparisons.runs.elsewhere import cool_down
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.render import Progress, render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Independent, Sobol
from reference_rt.util.errors import UsageError


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


MOST_TOLD = 200
"""Characters of a renderer's message that a reason quotes."""

BEST = "best"
"""Placeholder for the best sampler, which a trial determines."""


@dataclass(frozen=True)
class Method:
    """name: for files and options;  title: for people;  sampler: its name, or BEST;  side: "ours"
    or the Mitsuba variant, methods of which share what is loaded."""

    name: str
    title: str
    sampler: str
    side: str

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


METHODS = (
    Method("ours", "ours, Sobol' (default and best)", "sobol", "ours"),
    Method("ours_independent", "ours, independent", "independent", "ours"),
    Method("mitsuba_llvm", "Mitsuba llvm, independent (default)", "independent", LLVM),
    Method("mitsuba_llvm_best", "Mitsuba llvm, its best sampler", BEST, LLVM),
    Method("mitsuba_scalar", "Mitsuba scalar, independent (default)", "independent", SCALAR),
    Method("mitsuba_scalar_best", "Mitsuba scalar, its best sampler", BEST, SCALAR),
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
def failing(what: str) -> Iterator[None]:
    """Turn exceptions of Mitsuba and Dr.Jit into AbsentError: a method that fails must not stop the
    others."""
    try:
        yield
    except (RuntimeError, MemoryError) as error:
        raise AbsentError(f"{what}: {' '.join(str(error).split())[:MOST_TOLD]}") from None


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
    """Prepares methods and keeps what they share.  A context manager: it restores Mitsuba's variant
    at its end."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._entered = ExitStack()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._entered.close()

    def _in(self, side: str) -> Any:
        """Mitsuba in this variant, until another is needed: a switch defines its plugins again."""
        mi = mitsuba()
        if mi.variant() != side:
            self._entered.close()
            if mi.variant() != side:
                self._entered.enter_context(variant(side))
        return mi

    def ready(self, method: Method, progress: Progress | None = None) -> Renderer:
        """Load and compile.  Raises SceneError, ReferenceUnavailableError, AbsentError."""
        if method.side == "ours":
            return self._ours(method, progress)
        if method.side == LLVM and backend().variant != LLVM:
            raise AbsentError(f"Mitsuba's variant {LLVM} does not run here: {backend().reason}")
        copies = copies_of(self._scene)
        if any(member.tree is not None for copy in copies for member in copy.members):
            raise AbsentError("Mitsuba has no set operations")
        try:
            return self._mitsubas(method)
        except UntranslatableError as error:
            raise AbsentError(str(error)) from None

    def _ours(self, method: Method, progress: Progress | None) -> Renderer:
        scene = self._scene
        make: Callable[..., Sobol | Independent]
        make = Sobol if method.sampler == "sobol" else Independent
        tables = scene.tables
        # Far from the seeds that users choose, and from those of the reference.
        first = FIRST_SEED if method.sampler == "sobol" else 2 * FIRST_SEED

        def shot(spp: int, replicate: int) -> Shot:
            seeded = scene.changed(sampler=make(spp=spp, seed=first + replicate))
            cool_down()
            start = time.perf_counter()
            picture = render(seeded, tables=tables).colour
            return Shot(picture, spp, time.perf_counter() - start)

        small = scene.changed(sampler=make(spp=1, seed=first))
        # From now on the specialised kernels are in the cache, and `shot` uses them.
        render(small, tables=tables, progress=progress, specialised=True)
        return shot

    def _mitsubas(self, method: Method) -> Renderer:
        mi = self._in(method.side)
        description = to_mitsuba(self._scene, native=True)
        description["sensor"]["sampler"] = {"type": method.sampler}
        parts = [part for part in description.values() if isinstance(part, dict)]
        instances = sum(part.get("type") == "instance" for part in parts)
        if method.side == LLVM and instances > MOST_INSTANCES:
            raise AbsentError(
                f"{instances} instances, for which Mitsuba's llvm variant takes minutes to compile"
            )
        with failing("Mitsuba cannot load the scene"):
            mi_scene = mi.load_dict(description)
        sampler = mi_scene.sensors()[0].sampler()

        def shot(spp: int, replicate: int) -> Shot:
            mi = self._in(method.side)
            cool_down()
            start = time.perf_counter()
            with failing(f"Mitsuba cannot render {spp} samples per pixel"):
                # The array is what forces the lazy rendering to happen.
                found = np.array(mi.render(mi_scene, spp=spp, seed=seed_of(replicate)))
            seconds = time.perf_counter() - start
            return Shot(_three(found), int(sampler.sample_count()), seconds)

        return shot


FIRST_SEED = 1 << 40


def seed_of(replicate: int) -> int:
    """Mitsuba's 32-bit seeds, spread as multiples of the golden ratio: it adds the pixel index to
    the seed, so that close seeds would give different pixels the same random numbers."""
    return (1 + replicate) * 0x9E3779B1 % (1 << 32)


def _three(picture: Any) -> FloatArray:
    return np.asarray(picture, dtype=np.float64)[..., :3]

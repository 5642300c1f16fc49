"""Mitsuba by its own plugins: none of those that make it more exact."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from comparisons.geometry.flatten import copies_of
from comparisons.mitsuba import scene as mitsuba_scene
from comparisons.mitsuba.backend import SCALAR, backend, mitsuba, switch
from comparisons.renderers import NoCounterpartError, Replicates
from comparisons.translator import MOST_INSTANCES, to_mitsuba
from reference_rt.integrators import Whitted
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ReferenceUnavailableError

MOST_TOLD = 200
"""Characters of Mitsuba's message that a reason quotes."""


@dataclass(frozen=True)
class Native:
    """variant: of Mitsuba.  For pictures as small as those of truth the others compile longer than
    the scalar one renders;  sampler: its plugin, None for the translator's choice."""

    variant: str = SCALAR
    sampler: str | None = None
    title: str = "Mitsuba"

    def version(self) -> str:
        return f"{backend().version}, {self.variant}"

    @contextmanager
    def load(self, scene: Scene, threads: int | None = None) -> Iterator["_Loaded"]:
        """`comparisons.renderers.Renderer.load`; Mitsuba has all threads that it was started
        with.  Until the end of the context Mitsuba stays in the variant that was rendered last,
        since each switch defines its plugins again."""
        if self.variant != SCALAR and backend().variant != self.variant:
            reason = backend().reason
            raise ReferenceUnavailableError(
                f"Mitsuba's variant {self.variant} does not run here: {reason}"
            )
        if any(member.tree is not None for copy in copies_of(scene) for member in copy.members):
            raise NoCounterpartError("Mitsuba has no set operations")
        if isinstance(scene.integrator, Whitted):
            raise NoCounterpartError("Mitsuba has no recursive ray tracing")
        before = mitsuba().variant()
        try:
            switch(self.variant)
            description = to_mitsuba(scene, native=True)
            if self.sampler is not None:
                description["sensor"]["sampler"] = {"type": self.sampler}
            parts = [part for part in description.values() if isinstance(part, dict)]
            instances = sum(part.get("type") == "instance" for part in parts)
            if self.variant != SCALAR and instances > MOST_INSTANCES:
                raise NoCounterpartError(
                    f"{instances} instances, for which Mitsuba's variant {self.variant} takes "
                    "minutes to compile"
                )
            with failing("Mitsuba cannot load the scene"):
                mi_scene = mitsuba().load_dict(description)
            yield _Loaded(mi_scene, self.variant)
        finally:
            switch(before)


@dataclass
class _Loaded:
    mi_scene: Any
    variant: str

    def render(
        self, count: int, spp: int, seed: int = 0, say: Callable[[str], None] = lambda line: None
    ) -> Replicates:
        switch(self.variant)
        pictures, seconds = [], []
        with failing(f"Mitsuba cannot render {spp} samples per pixel"):
            for k in range(count):
                start = time.perf_counter()
                pictures.append(mitsuba_scene.picture(self.mi_scene, spp, (seed + k) % (1 << 32)))
                seconds.append(time.perf_counter() - start)
        # Some samplers round up: multijitter takes 35 for 32.
        taken = int(self.mi_scene.sensors()[0].sampler().sample_count())
        return Replicates(np.stack(pictures), np.array(seconds), taken)


@contextmanager
def failing(what: str) -> Iterator[None]:
    """Turn exceptions of Mitsuba and Dr.Jit into ReferenceUnavailableError."""
    try:
        yield
    except (RuntimeError, MemoryError) as error:
        told = " ".join(str(error).split())[:MOST_TOLD]
        raise ReferenceUnavailableError(f"{what}: {told}") from None


RENDERER = Native()

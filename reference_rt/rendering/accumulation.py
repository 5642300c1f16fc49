"""The sums of a picture's samples, and the layers that are made of them.

Kernels add up samples (`tiles`).  A picture's sums are arrays (pixels, width) by name: those of
`widths_of`.  They can be stored, and more samples added later: the same sums, bit for bit, as if
all had been added at once.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators import AnyIntegrator, Light, MediaPathSetup, RayCast, setup_of
from reference_rt.integrators.light import LightSetup
from reference_rt.lights.emission import Emission
from reference_rt.rendering.splats import splat_tile
from reference_rt.rendering.tiles import aov_tile, cost_tile, first_hits_tile, render_tile
from reference_rt.sampling import Grid
from reference_rt.scene.build import BuiltScene
from reference_rt.scene.build_media import camera_medium, media_of

Sums = dict[str, FloatArray]
"""Sums (n, width) of n pixels by name."""

OF_FIRST_HITS = ("albedo", "normal", "position")
"""Layers of `first_hits_tile`, in its order."""

_CENTRE = "centre"
_CENTRE_COLUMNS = {
    "colour": slice(0, 3),
    "distance": slice(3, 4),
    "normal": slice(4, 7),
    "id": slice(7, 8),
    "uv": slice(8, 10),
}
"""What the AOV pass writes for each pixel: values, not sums."""

_CENTRE_WIDTH = 10

COSTS = {"bvh_steps": slice(0, 1), "intersections": slice(1, 2)}
"""Layers of `cost_tile`, with its columns."""


@dataclass(frozen=True)
class Job:
    """A kernel of `tiles`.

    setup: the class of its integrator's setup, None for others;  arguments: from the scene, the
    view and the filter, as kernels take them, to the kernel's arguments before its sums;  sums: the
    names of these, "" for one that is absent;  columns: of a kernel that computes values, once for
    each pixel, instead of adding up samples: by name, the columns that are stored.
    """

    kernel: Any
    setup: type | None
    arguments: Callable[[Any, Any, Any], tuple[Any, ...]]
    sums: tuple[str, ...]
    columns: Mapping[str, slice] = field(default_factory=dict)

    def given(self, sums: Mapping[str, FloatArray]) -> tuple[Any, ...]:
        """The kernel's arguments for its sums."""
        return tuple(sums[name] if name else _ABSENT for name in self.sums)

    def empty(self) -> tuple[Any, ...]:
        """The same of no pixels, which have the same types."""
        width = _CENTRE_WIDTH if self.columns else 3
        return self.given(dict.fromkeys(self.sums, np.zeros((0, width))))


_ABSENT = np.zeros((0, 3))
"""In place of absent sums."""


def samples_of(scene: BuiltScene) -> int:
    """Samples per pixel: those of the sampler; one for ray casting, through the pixel's centre."""
    return 1 if isinstance(scene.integrator, RayCast) else scene.resolved_sampler.spp


def jobs_of(scene: BuiltScene) -> list[Job]:
    """The jobs that compute the sums of a scene's picture."""
    shape = (scene.film.width, scene.film.height)

    def centres(tables: Any, view: Any, film_filter: Any) -> tuple[Any, ...]:
        return tables, view, shape

    wanted = set(scene.film.layers)
    asked: dict[str, slice] = {name: columns for name, columns in COSTS.items() if name in wanted}
    costs = [Job(cost_tile, None, centres, (_CENTRE,), asked)] if asked else []
    if isinstance(scene.integrator, RayCast):
        return [Job(aov_tile, None, centres, (_CENTRE,), _CENTRE_COLUMNS), *costs]
    sampler = scene.resolved_sampler
    has_variance = "variance" in wanted
    setup = setup_for(scene, scene.integrator, not isinstance(sampler, Grid))
    jobs = [radiance_job(setup, sampler, shape, has_variance)]
    if set(OF_FIRST_HITS) & wanted:
        random_numbers = sampler.setup()

        def first_hits(tables: Any, view: Any, film_filter: Any) -> tuple[Any, ...]:
            return tables, view, film_filter, random_numbers, shape

        jobs.append(Job(first_hits_tile, None, first_hits, OF_FIRST_HITS))
    if {"depth", "id"} & wanted:
        columns = {name: _CENTRE_COLUMNS[name] for name in ("distance", "id")}
        jobs.append(Job(aov_tile, None, centres, (_CENTRE,), columns))
    return jobs + costs


def setup_for(scene: BuiltScene, integrator: AnyIntegrator, has_numbers: bool) -> Any:
    """`setup_of` an integrator, or that of paths through the scene's media."""
    assert not isinstance(integrator, RayCast)
    setup = setup_of(integrator, has_numbers)
    if scene.has_media:
        return MediaPathSetup(setup, media_of(scene), camera_medium(scene))
    return setup


def radiance_job(setup: Any, sampler: Any, shape: tuple[int, int], has_variance: bool) -> Job:
    """Radiance by the `setup()` of an integrator: sums "colour" and, for the variance, "m2"."""
    random_numbers = sampler.setup()

    def arguments(tables: Any, view: Any, film_filter: Any) -> tuple[Any, ...]:
        return setup, tables, view, film_filter, random_numbers, shape

    sums = ("colour", "m2" if has_variance else "")
    return Job(render_tile, type(setup), arguments, sums)


SPLATS = "splats"
"""The sums of particles: of a whole picture, not of a unit's pixels, since a particle with the
numbers of one pixel may be seen in any."""


def splat_job(scene: BuiltScene, emission: Emission) -> Job:
    """The particles of a scene with the integrator `light`: sums SPLATS."""
    integrator, film, sampler = scene.integrator, scene.film, scene.resolved_sampler.setup()
    assert isinstance(integrator, Light)
    setup, shape = integrator.setup(), (film.width, film.height)

    def arguments(tables: Any, view: Any, film_filter: Any) -> tuple[Any, ...]:
        return setup, emission, tables, view, film_filter, sampler, shape

    return Job(splat_tile, LightSetup, arguments, (SPLATS,))


def widths_of(scene: BuiltScene) -> dict[str, int]:
    """The names of a picture's sums, and the number of values that each has for a pixel."""
    wanted = set(scene.film.layers)
    costs = {name: 1 for name in COSTS if name in wanted}
    if isinstance(scene.integrator, RayCast):
        return {name: k.stop - k.start for name, k in _CENTRE_COLUMNS.items()} | costs
    widths = {"colour": 3} | costs
    if "variance" in wanted:
        widths["m2"] = 3
    if set(OF_FIRST_HITS) & wanted:
        widths |= dict.fromkeys(OF_FIRST_HITS, 3)
    if {"depth", "id"} & wanted:
        widths |= {"distance": 1, "id": 1}
    return widths


def add_samples(
    run: Callable[..., None], job: Job, sums: Sums, begin: int, end: int, first: int, last: int
) -> None:
    """Run a job's kernel for samples first to last - 1 of pixels begin to end - 1.

    run: the kernel, as a function of its sums by name and these numbers;  sums: of these pixels,
    which it adds to.
    """
    if not job.columns:
        run(sums, begin, end, first, last)
    elif first == 0:
        values = np.zeros((end - begin, _CENTRE_WIDTH))
        run({_CENTRE: values}, begin, end, first, last)
        for name, columns in job.columns.items():
            sums[name][:] = values[:, columns]


def layers_of(
    scene: BuiltScene, sums: Mapping[str, FloatArray], samples: IntArray | int
) -> dict[str, FloatArray]:
    """The layers (n, width), or (n,) for one value, of n pixels, from their sums.

    samples: how many the sums have; (n,) if pixels have different numbers.
    """
    count: Any = samples if isinstance(samples, int) else samples[:, None]
    with np.errstate(all="ignore"):  # infinite radiance, and pixels without samples
        if isinstance(scene.integrator, RayCast):
            return {name: _flat(sums[name].copy()) for name in sums}
        layers = {"colour": sums["colour"] / count}
        for name in scene.film.layers:
            if name == "variance":
                layers[name] = mean_and_variance(sums, count)[1]
            elif name in OF_FIRST_HITS:
                layers[name] = sums[name] / count
            else:
                layers[name] = _flat(sums["distance" if name == "depth" else name].copy())
    return layers


def mean_and_variance(sums: Mapping[str, FloatArray], spp: Any) -> tuple[FloatArray, FloatArray]:
    """The means (n, 3) of spp samples, whose sums are "colour", and the variances of these means,
    by the sums "m2" of squared deviations; a single sample has no estimate."""
    with np.errstate(all="ignore"):
        scale = np.divide(1.0, spp * (spp - 1.0))
        return sums["colour"] / spp, sums["m2"] * scale


def _flat(values: FloatArray) -> FloatArray:
    return values[:, 0] if values.shape[1] == 1 else values

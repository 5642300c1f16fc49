"""Deterministic scenes: errors of sample grids against the finest one, and Mitsuba against ours."""

import time

import numpy as np

from comparisons.compare import pictures
from comparisons.experiments.convergence.curves import GridPoint, Grids, GridStep
from comparisons.experiments.convergence.data import Settings, weights
from comparisons.experiments.convergence.methods import AbsentError, failing
from comparisons.experiments.convergence.store import Store
from comparisons.mitsuba.backend import backend
from comparisons.mitsuba.translate import UntranslatableError, load
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import RayCast
from reference_rt.rendering.image import display
from reference_rt.rendering.render import Progress, render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid

REPEATS = 3
"""Renders of each picture; the median of their seconds is reported."""

FINER = 4
"""The finest grid has this many times more samples along each axis than the finest grid that is
compared with it: its own error is then a few percent of that one's."""

MOST_ACROSS = 64
"""Samples along each axis of a pixel in the finest grid: its error is then below the 8 bits of a
display."""


WHOSE = {
    "ray_cast": "Mitsuba's picture is made from its hits of the rays through the pixel centres",
    "whitted": "Mitsuba's picture is rendered by our plugin, traced in Python: its time says "
    "little about Mitsuba",
}
"""Notes about Mitsuba's pictures, by integrator."""


def grids_of(
    scene: Scene, settings: Settings, store: Store, say: Progress
) -> tuple[Grids, list[str]]:
    """Our pictures on grids of 1, 4, 9, ... samples per pixel against the finest, and Mitsuba's.

    The finest grid takes at most half of the time limit.  Ray casting has one ray per pixel: its
    grid is a larger picture, averaged in display values.  Also returns what was not measured, and
    why.  Raises SceneError, ReferenceUnavailableError.
    """
    question = [settings.time_limit, settings.max_spp]
    stored, finest = store.fact("grids", question), store.picture("grid")
    if stored is not None and finest is not None:
        steps = tuple(GridStep(*step) for step in stored["steps"])
        points = tuple(GridPoint(*point) for point in stored["points"])
        finest = np.asarray(finest, np.float64)
        return Grids(steps, points, stored["finest"], finest), stored["left_out"]
    grids, left_out = _made(scene, settings, say)
    store.keep_picture("grid", grids.picture)
    fact = {"steps": grids.steps, "points": grids.points, "finest": grids.finest}
    store.keep_fact("grids", {**fact, "left_out": left_out}, question)
    return grids, left_out


def _made(scene: Scene, settings: Settings, say: Progress) -> tuple[Grids, list[str]]:
    left_out: list[str] = []
    say("finest grid", 0.0)
    timed(scene, 2)  # compiles
    seconds = timed(scene, 2)[1] / 4.0
    most_asked = FINER * int(settings.max_spp**0.5)
    across = int((0.5 * settings.time_limit / seconds) ** 0.5)
    across = min(max(across, 2), MOST_ACROSS, most_asked)
    finest = timed(scene, across)[0]
    say("finest grid", 1.0)
    most = max(1, across // FINER)
    if across < min(MOST_ACROSS, most_asked):
        left_out.append(
            f"grids of more than {most * most} samples per pixel: their reference, {FINER} times "
            f"finer along each axis, would take more than half of {settings.time_limit:g} s"
        )
    steps = []
    say("grids", 0.0)
    for n in range(1, most + 1):
        shots = [timed(scene, n) for _ in range(REPEATS)]
        mse, relmse = differences(shots[0][0], finest)
        steps.append(GridStep(n * n, float(np.median([s for _, s in shots])), mse, relmse))
        say("grids", n / most)
    points = []
    try:
        with failing("Mitsuba cannot render the scene"):
            points.append(_mitsubas(scene))
    except (UntranslatableError, AbsentError) as error:
        left_out.append(f"Mitsuba: {error}")
    return Grids(tuple(steps), tuple(points), across * across, finest), left_out


def timed(scene: Scene, n: int) -> tuple[FloatArray, float]:
    """The picture with n x n samples per pixel (ray casting: in display values) and its seconds."""
    start = time.perf_counter()
    if isinstance(scene.integrator, RayCast):
        film = scene.film
        size = {"width": n * film.width, "height": n * film.height}
        larger = scene.changed(film=film.model_copy(update=size))
        shown = display(render(larger, tables=scene.tables))
        picture = shown.reshape(film.height, n, film.width, n, 3).mean(axis=(1, 3))
    else:
        sampled = scene.changed(sampler=Grid(spp=n * n))
        picture = render(sampled, tables=scene.tables).colour
    return picture, time.perf_counter() - start


def differences(picture: FloatArray, other: FloatArray) -> tuple[float, float]:
    """The mean squared difference over pixels and channels, and the relative one."""
    squared = (picture - other) ** 2
    return float(squared.mean()), float((weights(other) * squared).mean())


def _mitsubas(scene: Scene) -> GridPoint:
    """Mitsuba's picture on the scene's own grid against ours.  Raises UntranslatableError."""
    casts = isinstance(scene.integrator, RayCast)
    sampler = Grid(spp=1) if casts else scene.resolved_sampler
    scene = scene.changed(sampler=sampler)
    counterpart = load(scene)
    if counterpart.no_light_reason and not casts:
        raise UntranslatableError(
            f"scene, in which {counterpart.no_light_reason},", "integrator for the"
        )
    ours = render(scene, tables=scene.tables)
    seconds = []
    for _ in range(REPEATS):  # the first compiles
        start = time.perf_counter()
        if casts:
            picture = pictures.mitsuba_cast(scene, counterpart, ours)[0]
        else:
            picture = pictures.mitsuba_whitted(scene, scene.tables, counterpart)
        seconds.append(time.perf_counter() - start)
    mse, relmse = differences(picture, display(ours) if casts else ours.colour)
    warm = float(np.median(seconds[1:]))
    return GridPoint(backend().variant, int(getattr(sampler, "spp", 1)), warm, mse, relmse)

"""The rung `transport`: the picture by paths from the camera against that by particles from the
lamps.

Both have the same expectation (Veach 1997, 4.7), by other samples: particles know no light
sampling, no multiple importance sampling, and no density with which another strategy would have
found a path.  What our path tracer and Mitsuba's have wrong alike, since both are written from the
same books, is seen here.

Particles say little of what few of them reach, and paths little of what few of them find.  The
statistics know both, by the noise of replicates and by light that few replicates met.  What they
cannot tell is no difference, and the reason says how large a bias could be overlooked.
"""

import math
from typing import Any

import numpy as np
from scipy import stats

from comparisons.integrators import particles_of
from comparisons.integrators.light import as_path
from comparisons.referee.sizes import ShapeSizes
from comparisons.renderers import NoCounterpartError
from comparisons.results.case import RungResult
from comparisons.rungs.rays.camera import camera_rays, pixel_centres
from comparisons.rungs.rays.light_context import DISTANT
from comparisons.statistics.cells import ROUNDING, Margins
from comparisons.statistics.decide import compare
from comparisons.statistics.wording import percent
from reference_rt.cameras.film import BoxFilter
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import Direct, Light, Path
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering import query
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Sobol
from reference_rt.util.errors import SceneError

LONGER = 24
"""Pixels along the picture's longer side: few, so that many particles are seen in each."""

TILE = 8
"""Pixels along a tile's side, of those whose means are compared."""

SAMPLES = 1 << 13
"""Paths, and particles, of a replicate."""

REPLICATES = 32

AGAIN = 8
"""Times as many samples, with other seeds, with which a difference must be seen again, and noise be
less, as that of finite variance is.  Light that few samples find may look like a difference, but
then more samples meet more of it, so that its noise hardly falls."""

SELDOM = 1e-4
"""How seldom normal noise that falls as it must seems not to."""

FEWEST = 1000.0
"""Least particles of suns and skies that may fall on what the camera sees, about two a pixel: they
come through the disk of the whole scene, and where that is thousands of times as wide, next to none
does."""

EXACT = Margins(image=0.0, tile=0.0, pixel=0.0, stored=0.0, constant=1e-9)
"""Both sides compute in float64, and leave surfaces by some 1e-15 of the scene: the rays that this
sends elsewhere, at the edges of shadows, are far fewer than 1e-9."""

FIRST_SEED = 7 << 40
"""Far from the seeds of users and of other experiments."""

WORST = 0.5
"""The largest bias that may be overlooked, of the image mean or of half of the tiles, for which a
result says something."""


def transport(scene: Scene, tables: SceneTables, threads: int | None = None) -> RungResult:
    """Compare small pictures by the scene's integrator and by `light`.  threads: None for all
    cores.  Raises SceneError."""
    if tables.lights.choice is None:
        return RungResult(
            "transport", "not-applicable", "there is no lamp that particles could leave"
        )
    if scene.has_media:
        return RungResult("transport", "not-applicable", "particles follow no media")
    paths = _small(scene)
    try:
        light = particles_of(paths.integrator)
    except NoCounterpartError as error:
        return RungResult("transport", "not-applicable", str(error))
    if light.max_depth is not None and light.max_depth < 2:
        return RungResult("transport", "not-applicable", "no light falls on any surface")
    if (count := _fall_on_view(paths, tables)) < FEWEST:
        reason = (
            f"of all particles of lights far away {count:.2g} fall on what the camera sees, in a "
            f"scene that is much larger; expected {FEWEST:g}"
        )
        return RungResult("transport", "not-applicable", reason)
    sides = paths, paths.changed(integrator=light)
    try:
        found, reached = _look(sides, tables, SAMPLES, FIRST_SEED, threads)
        if found.status == "differ" and _told(found):
            first, more = found, AGAIN * SAMPLES
            found, reached = _look(sides, tables, more, FIRST_SEED + 2 * REPLICATES, threads)
            if found.status == "differ" and not _noise_falls(first, found):
                return _told_too_little(reached, _kept(found, reached))
    except SceneError as error:
        return RungResult("transport", "not-applicable", f"no particles: {error.message}")
    return _judged(found, reached)


def _small(scene: Scene) -> Scene:
    """The scene's small picture, by `path` where it is by `light`, and with hidden lamps shown."""
    integrator, film = scene.integrator, scene.film
    if isinstance(integrator, Light):
        integrator = as_path(integrator)
    elif isinstance(integrator, Path | Direct):
        integrator = integrator.model_copy(update={"hide_emitters": False})
    share = min(1.0, LONGER / max(film.width, film.height))
    small: dict[str, Any] = {
        "width": max(1, round(share * film.width)),
        "height": max(1, round(share * film.height)),
        "filter": BoxFilter(),
        "layers": (),
    }
    return scene.changed(film=film.model_copy(update=small), integrator=integrator)


def _fall_on_view(scene: Scene, tables: SceneTables) -> float:
    """How many particles of lights far away, about, fall on a ball around the first hits of the
    camera's rays, of those that come through the ball around the scene; inf without such lights."""
    choice, sizes = tables.lights.choice, ShapeSizes(scene)
    if choice is None or not np.isfinite([sizes.lower, sizes.upper]).all():
        return math.inf
    share = float(choice.probability[np.isin(choice.kind, [*DISTANT])].sum())
    hits = query.intersect(tables, *camera_rays(scene, *pixel_centres(scene.film, LONGER**2)))
    p = hits.p[hits.shape >= 0]
    whole = float(np.linalg.norm(sizes.upper - sizes.lower))
    if share == 0.0 or len(p) == 0 or whole == 0.0:
        return math.inf
    seen = float(np.linalg.norm(np.ptp(p, axis=0)))
    return SAMPLES * REPLICATES * share * min(seen / whole, 1.0) ** 2


def _look(
    sides: tuple[Scene, Scene], tables: SceneTables, samples: int, seed: int, threads: int | None
) -> tuple[RungResult, float]:
    """What the statistics say of replicates, and the share of the lit pixels that some particle
    reaches, or the camera's own part.  Raises SceneError."""
    pictures: list[FloatArray] = []
    for side in sides[::-1]:  # first that which may be refused
        spp = max(1, samples // (side.film.width * side.film.height))
        pictures.append(
            np.array(
                [
                    render(
                        side.changed(sampler=Sobol(spp=spp, seed=seed + k)),
                        tables=tables,
                        threads=threads,
                    ).colour
                    for k in range(REPLICATES)
                ]
            )
        )
        seed += REPLICATES
    particles, paths = pictures
    lit = np.count_nonzero(paths, axis=(0, -1)) > 0
    reached = np.count_nonzero(particles, axis=(0, -1))[lit] > 0
    found = compare(paths, particles, limit=WORST, tile=TILE, margins=EXACT)
    return found, float(reached.mean()) if len(reached) else 1.0


def _judged(found: RungResult, reached: float) -> RungResult:
    """The result in the rung's words."""
    numbers = _kept(found, reached)
    if "image" not in found.numbers:
        return RungResult("transport", found.status, found.reason, numbers)
    told = _told(found)
    if not told and found.status != "invalid":
        return _told_too_little(reached, numbers)
    if found.status in ("differ", "invalid"):
        reason = f"paths from the camera against particles from the lamps: {found.reason}"
        return RungResult("transport", found.status, reason, numbers)
    reason = (
        f"particles from the lamps agree with paths from the camera; a bias of {' or '.join(told)} "
        f"would be seen; particles reach {reached:.0%} of the lit pixels"
    )
    return RungResult("transport", "agree", reason, numbers)


def _kept(found: RungResult, reached: float) -> dict[str, Any]:
    scales = {name: found.numbers.get(name) for name in ("image", "tiles", "pixels")}
    return {"lit_pixels_reached": reached, **scales}


def _told_too_little(reached: float, numbers: dict[str, Any]) -> RungResult:
    reason = (
        "particles from the lamps are too noisy to judge paths by; they reach "
        f"{reached:.0%} of the lit pixels"
    )
    return RungResult("transport", "not-applicable", reason, numbers)


def _noise_falls(few: RungResult, many: RungResult) -> bool:
    """Whether it does in each channel of the image mean that has noise, as the root of the samples,
    but for what variances of replicates scatter (F-test).  Of a channel in which both sides are
    black the statistics believe no error below ROUNDING, which does not fall."""
    one, two = (
        # None: without a bound, as of a channel in which there is no light.
        {of: math.inf if x is None else x for of, x in errors.items()}
        for errors in (look.numbers["standard_error_of_bias"] for look in (few, many))
    )
    scatter = float(stats.f.isf(SELDOM, REPLICATES - 1, REPLICATES - 1))
    noisy = [channel for channel, error in one.items() if error > 2.0 * ROUNDING]
    return all(AGAIN * two[channel] ** 2 <= scatter * one[channel] ** 2 for channel in noisy)


def _told(found: RungResult) -> list[str]:
    """What biases up to WORST would be seen, in words."""
    of_tiles = found.numbers["tiles"]
    biases = (
        (_largest(found.numbers["detectable_bias"]), "the image mean"),
        (_largest(of_tiles and of_tiles["median_detectable_bias"]), "half of the tiles"),
    )
    return [f"{percent(bias)} of {what}" for bias, what in biases if bias <= WORST]


def _largest(values: Any) -> float:
    """Of channels; infinite for what is not known."""
    several = list(values.values()) if isinstance(values, dict) else [values]
    return max(math.inf if value is None else float(value) for value in several)

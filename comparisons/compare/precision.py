"""Whether Mitsuba's precision explains a difference of pictures: what is left without it.

Which rays are beyond precision is foretold by their own geometry (`beyond_precision`): no light is
asked, so that a fault of light does not excuse itself.

Without noise, pixels that differ are drawn at random, and their ray trees are traced again in both
renderers.  A tree may differ only if its ray is beyond precision, or if the arbiter of the rung
`whitted` explains it; and the pixel must be the mean of its trees.  Of noisy pictures, pixels with
a ray beyond precision are left out.  The others see some of its effect indirectly: each later hit
of a path is a wrong one with a chance that was measured, and then shows other light.
"""

import numpy as np

from comparisons import statistics
from comparisons.compare.judge import Rendered
from comparisons.geometry.frame import round32
from comparisons.mitsuba.counterpart import Counterpart
from comparisons.results.case import FloatArray
from comparisons.rungs.limited import Rest
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.arbiter import BoolArray
from comparisons.rungs.rays.camera import camera_rays
from comparisons.rungs.rays.rays import Rays
from comparisons.rungs.rays.resolution import beyond_precision
from comparisons.rungs.whitted import Trees
from comparisons.statistics import Known, Margins
from reference_rt.core.arrays import IntArray
from reference_rt.integrators import Whitted
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering.scene import Scene

PIXELS = 200
"""Pixels that differ whose rays are traced again: if a tenth of them show a fault, that is proven
(`arbiter.too_many`) with a chance of 0.9999."""

FAINT, DARK = 1e-3, 1e-5
"""A pixel differs by more than the first of its own value and the second of the picture's white
(the 99th percentile)."""

OFF_MEAN = 1e-9
"""A pixel's own value against the mean of its trees, over the picture's white: both are float64."""

SIDES, RAYS = (2, 16), 1 << 18
"""Least and most rays along each side of a pixel of a noisy picture that are asked whether they are
beyond precision, and how many there may be in all where that allows for more: a sheet seen edge-on
lies between the rays of a coarse grid."""

OFTEN = 2.0
"""How much light indirect effects change, over the chance of a wrong hit: surfaces that reflect
half of the light meet two hits on the mean."""


def rest_of(
    scene: Scene,
    tables: SceneTables,
    counterpart: Counterpart,
    limit: float,
    rendered: Rendered,
    share: float,
) -> Rest:
    """What is left of the pictures.  limit: as in `statistics.compare`;  share: that of the limit
    that a rung found."""
    if rendered.resampled is not None:
        return _noisy(scene, tables, counterpart, rendered, limit, share)
    return _still(scene, tables, counterpart, rendered)


def _still(scene: Scene, tables: SceneTables, counterpart: Counterpart, rendered: Rendered) -> Rest:
    """Of pictures without noise."""
    ours, theirs = rendered.images.candidate, rendered.images.reference
    size = np.maximum(np.abs(ours), np.abs(theirs)).max(axis=2)
    lit = size > 0.0
    white = float(np.percentile(size[lit], 99.0)) if lit.any() else 0.0
    differs = ~(np.abs(ours - theirs).max(axis=2) <= FAINT * size + DARK * white)
    rows = np.flatnonzero(differs)
    some = np.random.default_rng(0).permutation(rows)[:PIXELS]
    if isinstance(scene.integrator, Whitted):
        wrong = _of_trees(scene, tables, counterpart, scene.integrator, some, ours, white)
    else:
        wrong = ~beyond_precision(scene, tables, counterpart, _rays(scene, some, 1))
    count = int(np.count_nonzero(wrong))
    text = f"of {len(some)} pixels that differ, precision does not explain {count}"
    if arbiter.too_many(count, len(some)):
        return Rest("differ", text)
    return _of_what_is_left(text, int(np.count_nonzero(lit & ~differs)), int(lit.sum()))


def _of_what_is_left(text: str, left: float, total: float) -> Rest:
    """left: of the picture's light or lit pixels, what agrees."""
    if left < arbiter.REST * total:
        return Rest("inconclusive", f"{text}, but they are most of the picture: too few are left")
    return Rest("agree", text)


def _of_trees(
    scene: Scene,
    tables: SceneTables,
    counterpart: Counterpart,
    integrator: Whitted,
    pixels: IntArray,
    ours: FloatArray,
    white: float,
) -> BoolArray:
    """(m,): of which pixels the ray trees do not explain the difference."""
    side = round(scene.resolved_sampler.spp**0.5)
    exact = _rays(scene, pixels, side)
    trees = Trees(scene, tables, counterpart, integrator)
    means = trees.of_ours(exact).reshape(len(pixels), -1, 3).mean(axis=1)
    off = np.abs(means - ours.reshape(-1, 3)[pixels]).max(axis=1)
    wrong = ~(off <= OFF_MEAN * white)
    rays = Rays(counterpart.frame.rounded(exact.o), round32(exact.d))
    compared = trees.compare(rays)
    outliers = compared.outliers
    beyond = beyond_precision(scene, tables, counterpart, rays.rows(outliers))
    rest = compared._replace(outliers=outliers[~beyond])
    left = rest.outliers[~trees.explained(rays, rest)[0]]
    wrong[left // (side * side)] = True
    return np.asarray(wrong)


def _noisy(
    scene: Scene,
    tables: SceneTables,
    counterpart: Counterpart,
    rendered: Rendered,
    limit: float,
    share: float,
) -> Rest:
    """Of noisy pictures."""
    keep = ~pixels_beyond(scene, tables, counterpart)[..., np.newaxis]
    assert rendered.replicates is not None
    candidate, reference = rendered.replicates
    more, usual = OFTEN * share, Margins()
    margins = Margins(image=usual.image + more, tile=usual.tile + more, pixel=usual.pixel + more)
    kept: FloatArray | Known
    if isinstance(reference, Known):
        kept = Known(reference.mean * keep, reference.variance * keep)
    else:
        kept = reference * keep
    again = statistics.compare(candidate * keep, kept, limit=limit + more, margins=margins)
    left = 100.0 * float(keep.mean())
    text = (
        f"without the pixels whose rays are beyond precision, {left:.0f} % of the picture is left, "
        f"of which up to {100.0 * more:.2g} % of the light may be changed indirectly"
    )
    if again.status in ("differ", "invalid"):
        return Rest("differ", f"{text}: {again.reason}")
    mean = rendered.images.reference
    return _of_what_is_left(text, float((mean * keep).sum()), float(mean.sum()))


def pixels_beyond(scene: Scene, tables: SceneTables, counterpart: Counterpart) -> BoolArray:
    """(height, width): in which pixels a ray is beyond precision."""
    film = scene.film
    every = np.arange(film.width * film.height)
    side = int(np.clip(np.sqrt(RAYS / len(every)), *SIDES))
    beyond = beyond_precision(scene, tables, counterpart, _rays(scene, every, side))
    return np.asarray(beyond.reshape(film.height, film.width, -1).any(axis=2))


def _rays(scene: Scene, pixels: IntArray, side: int) -> Rays:
    """side x side rays of each of the pixels, by number, row by row: those of a grid of samples."""
    row, column = np.divmod(pixels, scene.film.width)
    within = (np.mgrid[0:side, 0:side].reshape(2, 1, -1) + 0.5) / side
    y, x = row[:, None] + within[0], column[:, None] + within[1]
    return Rays(*camera_rays(scene, x.ravel(), y.ravel()))


__all__ = ["pixels_beyond", "rest_of"]

"""Pictures without noise that take the reference's own samples.

`edges` lets each pixel have samples of its own, up to a sixteenth of a pixel from their places: a
rasteriser's. A ray tracer that takes the samples of the scene's grid needs none of that, and hides
in it what is wrong where pixels show much: mirrors in mirrors, whose last reflection is a detail.

Whether a picture takes them, it shows itself. Pixels *tell* whose value would change by more than
the tolerance if its samples were moved by SNAP; if most of them have the reference's value, no
sample is further away. Then each pixel that differs must have a value that the reference's samples
have within SNAP of their places. Those that have none are *strays*.

Renderers weigh rays differently, and one that we drop for the little that it contributes another
one follows. Light adds, so that a pixel may have any value between those without and with all such
rays. Of POV-Ray's pictures 329 of 76,800 pixels (`whitted_classic`) and 22 of 64,000
(`spheres_whitted`) are beyond the tolerance of ours, and 4 and 1 of ours with all rays.
"""

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from comparisons.rungs.footprints import Look, look_at
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators import Whitted
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid

BoolArray = npt.NDArray[np.bool_]

Beyond = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""How far values are outside of low and high, with their sign."""

SNAP = 1.0 / 256.0
"""Pixels.  Float32 moves a camera's ray by 1e-4 of them, and what hits add seems to be as much: of
Mitsuba's pictures none has a stray even for 1/1024."""

FEWEST = 32
"""Fewest pixels that must tell."""

AT_EDGES = 0.2
"""Largest share of pixels on edges that may differ.  Two samples in place of one at the centre
change some 40 % of them."""

ASKED = 1 << 13
"""Most pixels of which it is asked whether they tell, and most of which whether they are strays,
evenly chosen."""

LARGEST = 1e-4
"""Permitted share of strays, or one: samples of other renderers may start further off a surface, or
be lost at the seam of two triangles."""

MOVES = 12
"""Places on each of two circles, of SNAP and of half of it, that a sample is moved to."""


def samples_of(scene: Scene) -> FloatArray | None:
    """The places (n, 2) of a pixel's samples, from 0 to 1, to the right and down; None unless they
    are those of a grid."""
    sampler = scene.resolved_sampler
    if not isinstance(sampler, Grid):
        return None
    n = round(sampler.spp**0.5)
    along = (np.arange(n) + 0.5) / n
    return np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)


def uncut(scene: Scene, threads: int | None = None) -> list[Look]:
    """What points of the film see where every ray is followed, however little it contributes; none
    of scenes without a tree of rays."""
    own = scene.integrator
    if not isinstance(own, Whitted):
        return []
    whole = own.model_copy(update={"min_contribution": 0.0})
    look = look_at(scene.changed(integrator=whole), threads)
    return [] if look is None else [look]


def strays(
    looks: Sequence[Look],
    beyond: Beyond,
    samples: FloatArray,
    pictures: tuple[FloatArray, FloatArray],
    differs: BoolArray,
    step: BoolArray,
) -> tuple[IntArray, IntArray] | None:
    """Rows and columns of strays; None if the candidate does not take the reference's samples, or
    too few pixels tell.

    looks: the scene's, and others between whose values and its own a pixel's may lie (`uncut`);
    beyond: as of `edges`;  samples: see `samples_of`;  pictures: the candidate and the reference,
    (height, width, 3);  differs, step (height, width): pixels beyond the tolerance, and those on
    edges.
    """
    candidate, reference = pictures
    height, width = differs.shape
    if np.count_nonzero(differs & step) > AT_EDGES * np.count_nonzero(step):
        return None
    asked = np.divmod(_evenly(np.arange(height * width)), width)
    known = reference[asked]
    low, high = _around(looks[:1], samples, *asked)
    tells = beyond(low, known, known).any(axis=-1) | beyond(high, known, known).any(axis=-1)
    wrong = np.count_nonzero(differs[asked][tells])
    if np.count_nonzero(tells) < FEWEST or 2 * wrong > np.count_nonzero(tells):
        return None
    row, column = (_evenly(x) for x in np.nonzero(differs))
    stray = ~are_seen(looks, beyond, samples, (row, column), candidate[row, column])
    return row[stray], column[stray]


def are_seen(
    looks: Sequence[Look],
    beyond: Beyond,
    samples: FloatArray,
    at: tuple[IntArray, IntArray],
    values: FloatArray,
) -> BoolArray:
    """(n,): whether the pixels in these rows and columns, `at`, have values (n, 3) that samples
    within SNAP of their places see; no for all if there are more than ASKED.  See `strays`."""
    if len(values) > ASKED:
        return np.zeros(len(values), bool)
    return np.asarray(~beyond(values, *_around(looks, samples, *at)).any(axis=-1))


def other_trees(scene: Scene, threads: int | None = None) -> list[tuple[str, FloatArray]]:
    """Our pictures (height, width, 3) of Whitted trees of other depths, by name; none of other
    scenes."""
    own = scene.integrator
    if not isinstance(own, Whitted):
        return []
    return [
        (name, render(scene.changed(integrator=other), threads=threads).colour)
        for name, depth in (
            ("one reflection fewer", max(own.max_depth - 1, 0)),
            ("one reflection more", own.max_depth + 1),
            ("many more reflections", own.max_depth + 8),
        )
        for other in [own.model_copy(update={"max_depth": depth})]
    ]


def permitted(pixels: int) -> int:
    """How many strays a picture may have."""
    return max(1, int(LARGEST * pixels))


def _evenly(numbers: IntArray) -> IntArray:
    some = np.linspace(0, len(numbers) - 1, min(len(numbers), ASKED)).astype(np.int64)
    return np.asarray(numbers[np.unique(some)])


def _around(
    looks: Sequence[Look],
    samples: FloatArray,
    row: IntArray,
    column: IntArray,
) -> tuple[FloatArray, FloatArray]:
    """The least and the largest value (n, 3), by any look, of n pixels whose samples are each moved
    by up to SNAP."""
    turn = 2.0 * np.pi * np.arange(MOVES) / MOVES
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    moves = SNAP * np.concatenate([np.zeros((1, 2)), circle, 0.5 * circle])
    corners = np.stack([column, row], axis=-1)[:, None, None]
    ends: list[tuple[FloatArray, FloatArray]] = []
    each = max(1, (1 << 19) // (len(samples) * len(moves)))  # pixels at once
    for k in range(0, max(len(row), 1), each):
        points = corners[k : k + each] + samples[:, None] + moves
        radiance = np.concatenate([look(points)[0] for look in looks], axis=2)
        ends.append((radiance.min(axis=2).mean(axis=1), radiance.max(axis=2).mean(axis=1)))
    low, high = (np.concatenate(column) for column in zip(*ends, strict=True))
    return low, high

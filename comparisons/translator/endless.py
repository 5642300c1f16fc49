"""Media without end: those in which rays leave a scene.

A closed shape may have the same medium within as another one around it, as glass in a ball of fog,
or elsewhere; only lines through the shapes tell whether what is around them has an end.
"""

import numpy as np

from comparisons.mitsuba.hits import rows_of
from comparisons.referee.sizes import ShapeSizes
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.rendering.scene import Scene

LINES = 64
"""Lines through each shape that bounds a medium."""

MOST = 64
"""Most surfaces that a line is followed through."""

STEP = 1e-9
"""From one surface towards the next, over the scene's diagonal."""


def left_in(scene: Scene) -> set[str]:
    """The media that lines through the scene's finite shapes with media are in behind their last
    surface.  They come from where there is no medium; all surfaces let them pass."""
    sizes, names = ShapeSizes(scene), [None, *scene.media]
    number = {id(leaf): k for k, leaf in enumerate(sizes.leaves)}
    sides, points = np.full((len(sizes.leaves) + 1, 2), -1), list[FloatArray]()
    for copy in sizes.copies:
        by_part = sizes.by_part(copy)
        for leaf in (leaf for member in copy.members for leaf in member.leaves):
            known = by_part[leaf.part]
            if leaf.interior is None and leaf.exterior is None:
                continue
            sides[number[id(known)]] = names.index(leaf.interior), names.index(leaf.exterior)
            if known.is_finite:
                low, high = known.bounds
                at = np.random.default_rng(len(points)).uniform(low, high, (LINES, 3))
                points.append(at @ copy.outer[:, :3].T + copy.outer[:, 3])
    if not points:
        return set()
    p, size = np.concatenate(points), float(np.linalg.norm(sizes.upper - sizes.lower))
    d = np.random.default_rng(0).normal(size=p.shape)
    d /= np.linalg.norm(d, axis=1)[:, None]
    behind = _behind_all(scene, sizes, sides, p - 2.0 * size * d, d, STEP * size)
    return {name for k in behind if (name := names[k]) is not None}


def _behind_all(
    scene: Scene, sizes: ShapeSizes, sides: IntArray, o: FloatArray, d: FloatArray, step: float
) -> set[int]:
    """The numbers of the media in which lines are behind their last surface.  sides (leaves + 1,
    2): those within and around each leaf, -1 for a surface that is no boundary."""
    inside, found = np.zeros(len(o), np.int64), set()
    for _ in range(MOST):
        hits = scene.intersect(o, d)
        found |= set(inside[hits.shape < 0].tolist())
        met = np.flatnonzero(hits.shape >= 0)
        if len(met) == 0:
            break
        hits, d, inside = rows_of(hits, met), d[met], inside[met]
        enters = np.einsum("ni,ni->n", hits.n, d) < 0.0
        of = sides[sizes.leaf_of(hits)]
        behind = np.where(enters, of[:, 0], of[:, 1])
        inside, o = np.where(behind >= 0, behind, inside), hits.p + step * d
    return found

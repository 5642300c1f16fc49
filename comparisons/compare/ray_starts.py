"""Whether Mitsuba's ray epsilon explains a difference between pictures of glass.

Mitsuba's integrators start a ray (1 + max |p|) RAY_EPSILON off the surface that it leaves.  Light
that total reflection keeps in glass for tens of bounces is moved inwards at each, meets the surface
ever more steeply, and leaves too soon: a diamond shows 2.7 % too much of the light of paths with
more than 20 edges, a quarter of a percent of its picture.  No single ray hits a wrong surface, so
that the rungs on rays do not see it.

So Mitsuba is compared with itself: our integrator, run in Mitsuba, renders pairs of pictures with
the same random numbers, whose rays start at Mitsuba's ray epsilon and at float32's error.  Where
the two differ for certain, and our picture differs no longer from Mitsuba's once that effect is
added, the picture shows Mitsuba's precision.  A fault of ours has no effect on either of the two.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from scipy import special

from comparisons import statistics
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.counterpart import Counterpart
from comparisons.mitsuba.lit_scene import LitScene
from comparisons.mitsuba.plugins.base import is_wide
from comparisons.mitsuba.scene import picture
from comparisons.results.case import FloatArray, RungResult
from comparisons.translator.mistakes import in_place_of
from reference_rt.integrators import Path
from reference_rt.materials import Dielectric, RoughDielectric
from reference_rt.rendering.scene import Scene

FOLLOWED = 10
"""Edges of paths that the Whitted rung follows: what shorter paths show is judged there."""

DEPTH = 100
"""Edges of the longest paths in the pairs: each takes as long as the first, and in a diamond five
sixths of the light of more than 20 edges has fewer than this many."""

PAIRS = 16
"""Most pairs of pictures: their spread is the noise of the effect."""

RAYS = 1 << 18
"""Camera rays of a picture of a pair in one pass."""

SURE = 1e-3
"""Chance that noise alone looks like an effect, over three channels, at each of some ten passes.
To hide a fault it would also have to be as large as the fault."""

SHARE = 0.5
"""Least share of the difference that the effect must make up: a small effect whose pairs are noisy
would hide a fault of ours in their noise."""

FIRST_SEED = 1 << 19
"""Of the pairs: other than those of the pictures that are judged."""

Say = Callable[[str], None]


def may_matter(scene: Scene, counterpart: Counterpart) -> bool:
    """Whether paths are long enough in glass; none of the integrators that start rays close to a
    surface follow media."""
    if not isinstance(scene.integrator, Path) or scene.has_media:
        return False
    depth = scene.integrator.max_depth
    glass = any(isinstance(m, Dielectric | RoughDielectric) for m in scene.materials.values())
    return glass and (depth is None or depth > FOLLOWED) and counterpart.instanced_group is None


def explained(
    scene: Scene,
    counterpart: Counterpart,
    limit: float,
    seconds: float,
    say: Say,
    result: RungResult,
    replicates: tuple[FloatArray, FloatArray],
) -> tuple[RungResult, tuple[FloatArray, FloatArray] | None]:
    """The result of the rung of statistics, changed to `reference-limited` if Mitsuba's ray epsilon
    explains the difference, to `inconclusive` if it may; and then the replicates of both sides
    without that effect.

    limit: as in `statistics.compare`;  seconds: the time for pairs;  replicates: of both sides.
    """
    if not is_wide(mitsuba()):
        reason = (
            "; Mitsuba's ray epsilon may explain it, which is measured by variants that trace many "
            "rays at a time: --variant llvm_ad_rgb"
        )
        return replace(result, reason=result.reason + reason), None
    ours, theirs = (_grouped(side) for side in replicates)
    effect = Effect(scene, counterpart, min(len(ours), len(theirs)))
    start = time.perf_counter()
    say(
        "statistics: differ; measuring whether Mitsuba's ray epsilon explains it, for at most "
        f"{seconds:.0f} s"
    )
    while True:
        effect.render()
        again = statistics.compare(ours, theirs + effect.pictures, limit=limit)
        if effect.is_certain and again.status != "inconclusive":
            break
        if time.perf_counter() - start > seconds:
            if not effect.is_certain:
                return result, None
            break
    off = (ours.mean(axis=0) - theirs.mean(axis=0)).mean(axis=(0, 1))
    change, noise, off = (
        100.0 * x / theirs.mean(axis=(0, 1, 2)) for x in (effect.mean, effect.error, off)
    )
    k = int(np.argmax(np.abs(change) / noise))
    text = f"{change[k]:+.2g} ± {noise[k]:.1g} % in {'RGB'[k]}"
    if again.status == "differ":
        reason = f"{result.reason}; Mitsuba's ray epsilon, without which its picture changes by "
        return replace(result, reason=f"{reason}{text}, does not explain it"), None
    reason = (
        f"beyond Mitsuba's precision: its own picture changes by {text} if rays start at float32's "
        "error off surfaces, not at its ray epsilon"
    )
    rest = f"ours differs from it by {off[k]:+.2g} %, and with that change: {again.reason}"
    found = replace(
        result,
        status="inconclusive",
        reason=f"{reason}; {rest}",
        numbers={**result.numbers, "ray_epsilon": float(change[k]) / 100.0},
    )
    without = ours, theirs + effect.pictures
    left = abs(off[k] - change[k]) / max(abs(off[k]), abs(change[k]))
    if again.status == "inconclusive" or left > 1.0 - SHARE:
        return found, without
    reason += ", and ours does not differ from the picture with that change"
    found = replace(found, status="reference-limited", reason=f"{reason}; {result.reason}")
    return found, without


def _grouped(pictures: FloatArray) -> FloatArray:
    """At most PAIRS pictures, means of others."""
    size = -(-len(pictures) // PAIRS)
    count = len(pictures) // size
    grouped = pictures[: count * size].reshape(count, size, *pictures.shape[1:])
    return np.asarray(grouped.mean(axis=1))


class Effect:
    """Pictures with rays that start at float32's error minus those with Mitsuba's starts."""

    def __init__(self, scene: Scene, counterpart: Counterpart, pairs: int) -> None:
        assert isinstance(scene.integrator, Path)
        self.mi_scene, self.passes, self._pairs = counterpart.mi_scene, 0, pairs
        self._spp = max(1, RAYS // (scene.film.width * scene.film.height))
        depth = min(scene.integrator.max_depth or DEPTH, DEPTH)
        integrator = scene.integrator.model_copy(update={"max_depth": depth})
        described = in_place_of(scene.changed(integrator=integrator), has_solids=True)
        assert described is not None
        self._integrators = [
            mitsuba().load_dict({**described, "starts_close": close}) for close in (True, False)
        ]
        for integrator in self._integrators:
            integrator.lit = partial(
                LitScene, solids=counterpart.solids, planes=counterpart.planes()
            )
        self._sum = np.zeros((pairs, scene.film.height, scene.film.width, 3))

    def render(self) -> None:
        """One more pass: more samples of every pair."""
        for k in range(self._pairs):
            seed = FIRST_SEED + self.passes * self._pairs + k
            close, usual = (
                picture(self.mi_scene, self._spp, seed, integrator)
                for integrator in self._integrators
            )
            self._sum[k] += close - usual
        self.passes += 1

    @property
    def pictures(self) -> FloatArray:
        """The differences (pairs, height, width, 3)."""
        return self._sum / self.passes

    @property
    def mean(self) -> FloatArray:
        """(3,): the change of the image mean."""
        return np.asarray(self.pictures.mean(axis=(0, 1, 2)))

    @property
    def error(self) -> FloatArray:
        """(3,): its standard error."""
        means = self.pictures.mean(axis=(1, 2))
        return np.asarray(means.std(axis=0, ddof=1) / len(means) ** 0.5)

    @property
    def is_certain(self) -> bool:
        """Whether the image mean changes by more than its noise."""
        least = -special.stdtrit(self._pairs - 1, SURE / 6.0)
        return bool((np.abs(self.mean) > least * self.error).any())

"""What rays may hit in a scene with solids: exact arithmetic, and F7's law on what is resolved.

Crossings of operands further apart than twice the sum of the widths which ours states can be told
apart (`harness.solids.truths`); what lies between others may show or not.  No number is chosen
here.
"""

from typing import NamedTuple

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.core import FloatArray
from comparisons.experiments.stability.harness.solids import Truth, truths
from comparisons.geometry.exact.dyadic import nearest
from comparisons.geometry.exact.referee import Referee
from comparisons.geometry.exact.referee import Truth as First
from comparisons.geometry.sizes import ShapeSizes
from reference_rt.core.arrays import IntArray
from reference_rt.shapes.csg import Solid


class Met(NamedTuple):
    """What one ray meets: solids: of each by its number in the scene;  others: of everything else
    together;  t: of that, inf for none."""

    solids: dict[int, Truth]
    others: First
    t: float

    @property
    def touching(self) -> bool:
        return self.others.touching or any(truth.touching for truth in self.solids.values())

    def allows(self, name: IntArray, t: float) -> bool:
        """Whether something of this name (4,) at t, or nothing (-1, at inf), can be what is
        first."""
        shape, _, part, _ = identity = tuple(name.tolist())
        slack = 0.0
        for number, truth in self.solids.items():
            if any(stretch.inside and stretch.t0 < t for stretch in truth.stretches):
                return False  # it would be seen before
            if number == shape:
                near = np.abs(truth.crossings - t) <= 2.0 * truth.widths
                if part not in truth.operands[near] or not _may_change(truth, t):
                    return False
                slack = float(2.0 * truth.widths[near].max())
        if shape in self.solids or shape < 0:
            return self.t >= t - slack
        return identity in self.others.identities


def _may_change(truth: Truth, t: float) -> bool:
    """Whether the solid may begin at t, between stretches of which the one before is outside: it is
    there behind it, or between crossings that are not told apart."""
    behind = next(stretch for stretch in truth.stretches if stretch.t1 > t)
    reach = max((stretch.t1 for stretch in truth.stretches if stretch.t1 <= t), default=0.0)
    crossings = truth.crossings[(truth.crossings >= reach) & (truth.crossings <= behind.t0)]
    return behind.inside or len(crossings) > 1


class Judge:
    """Of rays in one scene, whose solids are made of what `rt.csg` lists and stand in no groups."""

    def __init__(self, scene: rt.Scene) -> None:
        self.scene = scene
        sizes = ShapeSizes(scene)
        self.bounds = np.array([sizes.lower, sizes.upper])
        numbered = list(enumerate(scene.shapes))
        self.solids = {k: shape for k, shape in numbered if isinstance(shape, Solid)}
        self.number = [k for k, _ in numbered if k not in self.solids]
        others = tuple(shape for k, shape in numbered if k not in self.solids)
        self.referee = Referee(ShapeSizes(scene.changed(shapes=others)))

    def decide(self, o: FloatArray, d: FloatArray) -> list[Met]:
        if len(o) == 0:
            return []
        solids = {k: truths(s, self.scene.folder, o, d) for k, s in self.solids.items()}
        found = []
        for ray, first in enumerate(self.referee.decide(o, d)):
            first.identities = [(self.number[s], i, p, k) for s, i, p, k in first.identities]
            t = float(nearest(np.array([first.t], dtype=object))[0])
            found.append(Met({k: some[ray] for k, some in solids.items()}, first, t))
        return found

"""A Mitsuba scene together with the CSG solids that Mitsuba lacks, traced as one scene.

`ray_intersect` returns Mitsuba's own surface interactions, so that integrators written in Python
(`comparisons.mitsuba.plugins`) shade with Mitsuba's BSDFs and emitters.  A ray walks from crossing
to crossing of all operands at once; the solid's surface is where the set operation changes.  Code
and method are independent of `reference_rt.accel.csg`, and of `csg.SolidCounterpart`, which sorts
all crossings of each ray in float64.

Works in scalar variants and in wide ones, where all rays are traced together.
"""

from collections.abc import Collection
from typing import Any, NamedTuple

from comparisons.geometry import affine
from comparisons.geometry.frame import ROUNDINGS, UNIT_ROUNDOFF
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.csg import (
    MOST_CROSSINGS,
    SLIGHT,
    STEEPEST,
    Operand,
    SolidCounterpart,
    evaluated,
)
from comparisons.mitsuba.hits import CURVED
from comparisons.mitsuba.plugins.base import PlainScene, is_wide
from reference_rt.shapes import Plane

NONE = 0xFFFFFFFF
"""The operand of a ray that misses a solid."""


class LitScene(PlainScene):
    """What integrators and rungs of light need of a scene with solids.

    mi_scene: Mitsuba's scene without the solids, which has the camera and all sampled lights.
    """

    def __init__(
        self, mi_scene: Any, solids: tuple[SolidCounterpart, ...], planes: Collection[str] = ()
    ) -> None:
        super().__init__(mitsuba(), mi_scene, planes)
        self._solids = [_Solid(solid) for solid in solids]

    def ray_test(self, ray: Any, active: Any = True) -> Any:
        blocked = super().ray_test(ray, active)
        for solid in self._solids:
            rest = active & (blocked ^ True)
            blocked |= solid.first(ray, ray.maxt, rest).operand != NONE
        return blocked

    def trace(self, ray: Any, active: Any = True) -> tuple[Any, Any]:
        import drjit as dr

        si, of_solid = super().trace(ray, active)
        for solid in self._solids:
            crossing = solid.first(ray, dr.minimum(ray.maxt, si.t), active)
            met = crossing.operand != NONE
            if dr.any(met):
                si = solid.interaction(ray, crossing, si)
                of_solid |= met
        dr.eval(si, of_solid)
        return si, of_solid

    def all_scenes(self) -> list[Any]:
        of_solids = [o.mi_scene for solid in self._solids for o in solid.solid.operands]
        return [self.mi_scene, *of_solids]


class _Found(NamedTuple):
    """The rays' first hits on a solid.  operand: its number, NONE for a miss;  start: a distance
    from the ray's origin shortly before the hit;  enters: whether the ray enters the solid."""

    operand: Any
    start: Any
    enters: Any


class _Crossing(NamedTuple):
    """A ray's next crossing with an operand: the distance t from the ray's origin, inf for none;
    slack: how far float32 may have moved it;  enters: whether the ray enters the operand;  start:
    where the search for it started."""

    t: Any
    slack: Any
    enters: Any
    start: Any


class _Solid:
    """A solid in the variant that is set."""

    def __init__(self, solid: SolidCounterpart) -> None:
        self.solid = solid
        self.operands = [_Operand(operand) for operand in solid.operands]

    def first(self, ray: Any, limit: Any, active: Any) -> _Found:
        """The first hits of active rays at distances up to `limit`; of wide variants' rays only
        those are walked that pass near the solid."""
        import drjit as dr

        mi = mitsuba()
        active = mi.Mask(active) & self._near(ray, limit)
        if not is_wide(mi):
            return self._walk(ray.o, ray.d, limit, active)
        n = dr.width(ray)
        # Columns that are the same for all rays have one entry, from which nothing can be gathered.
        each = dr.arange(mi.UInt32, n) < n
        whole: list[Any] = [
            dr.select(each, column, 0.0) for column in (ray.o, ray.d, mi.Float(limit))
        ]
        active &= each
        # In one go: each column alone would take a kernel that traces all that led to it again.
        dr.eval(whole, active)
        rows: Any = dr.compress(active)
        none = dr.full(mi.UInt32, NONE, n)
        result = _Found(none, dr.zeros(mi.Float, n), dr.zeros(mi.Mask, n))
        if dr.width(rows) == 0:
            return result
        o, d, end = (dr.gather(type(column), column, rows) for column in whole)
        some = self._walk(o, d, end, dr.full(mi.Mask, True, dr.width(rows)))
        for column, values in zip(result, some, strict=True):
            dr.scatter(column, values, rows)
        return result

    def _near(self, ray: Any, limit: Any) -> Any:
        """Whether rays pass near the solid before `limit`."""
        import drjit as dr

        mi, box = mitsuba(), self.solid.box()
        d = dr.select(dr.abs(ray.d) < 1e-20, 1e-20, ray.d)
        a, b = ((mi.Vector3f(side.tolist()) - mi.Vector3f(ray.o)) / d for side in box)
        begin, end = dr.max(dr.minimum(a, b)), dr.min(dr.maximum(a, b))
        return (begin <= end) & (end >= 0.0) & (begin <= limit)

    def _walk(self, o: Any, d: Any, limit: Any, active: Any) -> _Found:
        """Step to the next crossing of any operand, or to all that count as one, until the solid
        is entered or left."""
        import drjit as dr

        mi = mitsuba()
        tree, count = self.solid.tree, range(len(self.operands))
        following = [operand.following(o, d, mi.Float(0.0), active) for operand in self.operands]
        states = [self.operands[k].begins_inside(o, following[k]) for k in count]
        began = evaluated(tree, states)
        found = mi.UInt32(NONE)
        for _ in range(MOST_CROSSINGS):
            t, slack = mi.Float(dr.inf), mi.Float(0.0)
            for crossing in following:
                slack = dr.select(crossing.t < t, crossing.slack, slack)
                t = dr.minimum(crossing.t, t)
            active &= (t <= limit) & (t < dr.inf)
            if not dr.any(active):
                break
            together = [active & (c.t - t <= SLIGHT * (c.slack + slack)) for c in following]
            flips = [together[k] & (following[k].enters != states[k]) for k in count]
            now = [states[k] ^ flips[k] for k in count]
            changes = active & (evaluated(tree, now) != began)
            for k in reversed(count):
                alone, others = list(states), list(now)
                alone[k], others[k] = now[k], states[k]
                shows = (evaluated(tree, alone) != began) | (evaluated(tree, others) == began)
                found = dr.select(changes & flips[k] & shows, mi.UInt32(k), found)
            active &= changes ^ True
            for k in count:
                following[k] = self.operands[k].after(o, d, following[k], active & together[k])
            states = [dr.select(active, now[k], states[k]) for k in count]
            # As plain tuples: Dr.Jit ignores named ones.
            dr.eval([tuple(crossing) for crossing in following], states, found, active)
        start = mi.Float(0.0)
        for k in count:
            start = dr.select(found == k, following[k].start, start)
        return _Found(found, start, began ^ True)

    def interaction(self, ray: Any, crossing: _Found, si: Any) -> Any:
        """`si`, overwritten where the solid was found; normals point out of the solid."""
        import drjit as dr

        mi = mitsuba()
        for k, operand in enumerate(self.operands):
            mine = crossing.operand == k
            if not dr.any(mine):
                continue
            start = dr.select(mine, crossing.start, 0.0)
            near = mi.Ray3f(ray.o + ray.d * start, ray.d, ray.time, ray.wavelengths)
            other = operand.mi_scene.ray_intersect(near, mine)
            other.t += start
            si = dr.select(mine, other, si)
        met = crossing.operand != NONE
        turned = met & ((dr.dot(si.n, ray.d) < 0.0) != crossing.enters)
        si.n = dr.select(turned, -si.n, si.n)
        si.sh_frame.n = dr.select(turned, -si.sh_frame.n, si.sh_frame.n)
        si.initialize_sh_frame()
        si.wi = dr.select(met, si.to_local(-ray.d), si.wi)
        return si


class _Operand:
    """An operand, and the lengths that bound its errors."""

    def __init__(self, operand: Operand) -> None:
        self.mi_scene = operand.mi_scene
        plugins = [mi_shape.plugin for mi_shape in operand.mi_shapes.values()]
        self.sag = max((p.stand_in.sag for p in plugins if p.stand_in), default=0.0)
        self.curved = max((1.0 / p.curved for p in plugins if p.curved > 0.0), default=0.0)
        self.reach = operand.reach()
        self.plane: Any = None
        if isinstance(operand.leaf.shape, Plane):
            self.plane = affine.invert(affine.map_in(operand.leaf.shape, operand.place))[2].tolist()

    def begins_inside(self, o: Any, first: _Crossing) -> Any:
        """Whether rays start inside: their first crossing leaves the operand."""
        import drjit as dr

        outside = False
        if self.plane is not None:
            outside = dr.dot(o, mitsuba().Vector3f(self.plane[:3])) + self.plane[3] < 0.0
        return dr.select(first.t < dr.inf, first.enters ^ True, outside)

    def following(self, o: Any, d: Any, start: Any, active: Any) -> _Crossing:
        """The first crossing at distances beyond `start`."""
        import drjit as dr

        mi = mitsuba()
        begin = o + d * start
        ray = mi.Ray3f(begin, d)
        si = self.mi_scene.ray_intersect(ray, mi.RayFlags.Minimal, False, active)
        met = active & si.is_valid()
        cosine = dr.dot(si.n, d)
        size = dr.max(dr.abs(o)) + dr.max(dr.abs(si.p)) + self.reach
        size = ROUNDINGS * UNIT_ROUNDOFF * size + self.sag
        size += CURVED * UNIT_ROUNDOFF * self.curved * si.t * si.t
        slack = size / dr.maximum(dr.abs(cosine), 1.0 / STEEPEST)
        return _Crossing(
            dr.select(met, start + si.t, dr.inf),
            dr.select(met, slack, 0.0),
            cosine < 0.0,
            start,
        )

    def after(self, o: Any, d: Any, crossing: _Crossing, active: Any) -> _Crossing:
        """The next crossing of active rays; others keep theirs."""
        import drjit as dr

        start = dr.select(active, crossing.t + 0.5 * crossing.slack, crossing.start)
        further = self.following(o, d, start, active)
        return _Crossing(*(dr.select(active, a, b) for a, b in zip(further, crossing, strict=True)))

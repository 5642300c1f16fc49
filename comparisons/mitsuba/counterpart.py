"""A scene's counterpart in Mitsuba, and the first hits of rays in it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from comparisons.geometry.frame import OURS, Frame
from comparisons.mitsuba.backend import mitsuba, scalar
from comparisons.mitsuba.csg import SLIGHT, SolidCounterpart
from comparisons.mitsuba.hits import (
    BoolArray,
    MitsubaHits,
    MitsubaShape,
    StandIn,
    assign,
    assign_nearer,
    misses,
    read,
)
from comparisons.mitsuba.lit_scene import LitScene
from comparisons.mitsuba.plugins.base import is_wide
from comparisons.mitsuba.scene import first_hits
from reference_rt.core.arrays import FloatArray, IdArray, IntArray
from reference_rt.rendering.query import Intersections


class InstancedGroup(NamedTuple):
    """All instances of a scene with many, in a scene of Mitsuba's scalar variant.

    Other variants compile code for every shape, half a minute for a thousand instances.  mi_shapes:
    the primitives that the instances represent, by id.
    """

    mi_scene: Any
    mi_shapes: Mapping[str, MitsubaShape]


@dataclass(frozen=True)
class Counterpart:
    """A scene's counterpart in Mitsuba.

    mi_scene: Mitsuba's scene, without solids and instanced group;  mi_shapes: what its shapes
    represent, by id;  solids: counterparts of CSG solids;  instanced_group: the instances, if there
    are many, else None;  frame: the coordinates of all these, and of the lengths in them;
    has_our_integrator: whether a picture is rendered by `plugins.path_of_solids`.
    """

    mi_scene: Any
    mi_shapes: Mapping[str, MitsubaShape]
    solids: tuple[SolidCounterpart, ...] = ()
    instanced_group: InstancedGroup | None = None
    frame: Frame = OURS
    has_our_integrator: bool = False

    def sensors(self) -> Any:
        """Mitsuba's sensors."""
        return self.mi_scene.sensors()

    @cached_property
    def lit(self) -> LitScene:
        """Mitsuba's scene with the solids."""
        return LitScene(self.mi_scene, self.solids, self.planes())

    @property
    def no_light_reason(self) -> str:
        """Why light cannot be compared; empty if it can."""
        if self.instanced_group is not None:
            count = len(self.instanced_group.mi_shapes)
            return f"{count} instances: Mitsuba takes minutes to compile its integrators for them"
        return ""

    @property
    def no_pictures_reason(self) -> str:
        """Why pictures with noise cannot be compared; empty if they can."""
        if self.has_our_integrator and not is_wide(mitsuba()):
            others = "hidden lamps, partly opaque masks, and lamps behind what is no surface"
            what = "solids (CSG)" if self.solids else others
            return (
                f"{what}: Mitsuba's scalar variant would take hours for their pictures, which our "
                "plugin traces ray by ray; its variant llvm_ad_rgb takes seconds (docs/install.md)"
            )
        return self.no_light_reason

    def notes(self) -> list[str]:
        """Notes on a moved frame, and on meshes that stand in for shapes."""
        return self._moved() + [
            f"a mesh of {s.triangles:,} triangles stands in for shape {shape} ({s.name}); it is at "
            f"most {s.sag:.2g} off, {s.ratio:.2g} times that with half as many triangles a side"
            for shape, stand_ins in self.stand_ins().items()
            for s in dict.fromkeys(stand_ins)
        ]

    def _moved(self) -> list[str]:
        if self.frame.is_ours:
            return []
        middle = ", ".join(f"{x:.6g}" for x in self.frame.center)
        return [
            f"Mitsuba renders the scene moved by minus ({middle}) and scaled by "
            f"{self.frame.scale:.6g}: otherwise its rays would start more than a hundredth of the "
            "scene's size off surfaces"
        ]

    def all_mi_shapes(self) -> list[MitsubaShape]:
        """The Mitsuba shapes of all scenes, operands of solids included."""
        mi_shapes = list(self.mi_shapes.values())
        if self.instanced_group is not None:
            mi_shapes += self.instanced_group.mi_shapes.values()
        for solid in self.solids:
            for operand in solid.operands:
                mi_shapes += operand.mi_shapes.values()
        return mi_shapes

    def planes(self) -> frozenset[str]:
        """The ids of finite meshes that stand in for infinite planes."""
        scenes = [self.mi_shapes, *(o.mi_shapes for s in self.solids for o in s.operands)]
        return frozenset(
            name for named in scenes for name, shape in named.items() if shape.plugin.extent
        )

    def has_planes(self) -> bool:
        """Whether finite meshes stand in for infinite planes."""
        return any(mi_shape.plugin.extent for mi_shape in self.all_mi_shapes())

    def beyond_planes(self, ours: Intersections, theirs: Intersections) -> BoolArray:
        """(n,): whether our hit is on a shape with an infinite plane, beyond the finite mesh that
        stands in for it.  Not where Mitsuba's ray hits that mesh."""
        beyond, apart = np.zeros(len(ours.t), bool), ours.shape != theirs.shape
        for mi_shape in self.all_mi_shapes():
            extent = mi_shape.plugin.extent
            if extent is not None:
                away = np.linalg.norm(ours.p - self.frame.out(extent.middle), axis=1)
                beyond |= (
                    apart
                    & (ours.shape == mi_shape.shape)
                    & (away > extent.radius / self.frame.scale)
                )
        return beyond

    def stand_ins(self) -> dict[int, list[StandIn]]:
        """The errors of meshes that stand in for curved surfaces, by the index of the shape, in
        scene units."""
        by_shape: dict[int, list[StandIn]] = {}
        for mi_shape in self.all_mi_shapes():
            if mi_shape.plugin.stand_in is not None:
                one = mi_shape.plugin.stand_in
                scale = self.frame.scale
                one = one._replace(
                    sag=one.sag / scale, slip=one.slip / scale, shift=one.shift / scale
                )
                by_shape.setdefault(mi_shape.shape, []).append(one)
        return by_shape

    def off_by(self, shapes: IdArray | IntArray, *errors: str) -> FloatArray:
        """(n,): the largest sum of these errors of the meshes that stand in for `shapes` (n,), in
        scene units; 0 for other shapes and for none, -1."""
        by_shape = self.stand_ins()
        values = np.zeros(max(int(shapes.max(initial=-1)), *by_shape, -1) + 2)
        for shape, stand_ins in by_shape.items():
            values[shape] = max(sum(getattr(s, name) for name in errors) for s in stand_ins)
        return np.asarray(values[shapes])

    def sags(self) -> dict[int, float]:
        """The largest distance between a shape and the mesh that stands in for it, by the index of
        the shape, in scene units."""
        return {
            shape: max(s.sag for s in stand_ins) for shape, stand_ins in self.stand_ins().items()
        }


def trace(
    counterpart: Counterpart,
    o: FloatArray,
    d: FloatArray,
    tolerance: float = SLIGHT,
    t_max: FloatArray | float = np.inf,
) -> MitsubaHits:
    """Mitsuba's first hits before t_max (n,), in the same form as `reference_rt.query.intersect`
    returns ours.

    Mitsuba gets the rays in the counterpart's frame, rounded to float32.  `tolerance`: see
    `SolidCounterpart.trace`.
    """
    if counterpart.frame.is_ours:
        hits = _trace(counterpart, o, d, tolerance)
    else:
        hits = _trace(counterpart, counterpart.frame.into(o), d, tolerance)
        scale = counterpart.frame.scale
        met = hits.shape >= 0
        hits.p[met] = counterpart.frame.out(hits.p[met])
        t, sag, height = hits.t / scale, hits.sag / scale, hits.height / scale
        hits = replace(hits, t=t, sag=sag, height=height)
    beyond = np.flatnonzero(np.isfinite(hits.t) & (hits.t >= t_max))
    assign(hits, beyond, misses(len(beyond)))
    return hits


def _trace(counterpart: Counterpart, o: FloatArray, d: FloatArray, tolerance: float) -> MitsubaHits:
    """The same in the counterpart's coordinates."""
    hits = _hits(counterpart.mi_scene, counterpart.mi_shapes, o, d)
    everything = np.arange(len(o))
    if counterpart.instanced_group is not None and len(o) > 0:
        with scalar():
            assign_nearer(
                hits,
                everything,
                _hits(
                    counterpart.instanced_group.mi_scene,
                    counterpart.instanced_group.mi_shapes,
                    o,
                    d,
                ),
            )
    for solid in counterpart.solids:
        near = solid.box().near(o, d)
        if len(near) == 0:
            continue
        assign_nearer(hits, near, solid.trace(o[near], d[near], tolerance))
    return hits


def _hits(
    mi_scene: Any, mi_shapes: Mapping[str, MitsubaShape], o: FloatArray, d: FloatArray
) -> MitsubaHits:
    if not mi_shapes or len(o) == 0:  # Dr.Jit does not accept empty arrays
        return misses(len(o))
    ids = {name: k for k, name in enumerate(mi_shapes)}
    return read(first_hits(mi_scene, ids, o, d), list(mi_shapes.values()), o)

"""A scene's twin in Mitsuba, and what rays hit in it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from comparisons.geometry.frame import OURS, Frame
from comparisons.mitsuba.backend import scalar
from comparisons.mitsuba.csg import SLIGHT, SolidTwin
from comparisons.mitsuba.hits import Answers, nothing, put_nearer, read
from comparisons.mitsuba.scene import first_hits
from comparisons.mitsuba.stand_ins import Extent, Piece, StandIn
from reference_rt.core.arrays import FloatArray


class Crowd(NamedTuple):
    """Instances in a scene of Mitsuba's scalar variant, where they are many: in others, every shape
    is asked about every other, so that a thousand instances take half a minute to compile.

    pieces: what the instances stand for, by their ids.
    """

    mi_scene: Any
    pieces: Mapping[str, Piece]


@dataclass(frozen=True)
class Twin:
    """mi_scene: Mitsuba's scene, without what follows;  pieces: what its shapes stand for, by their
    ids;  solids: what set operations make;  crowd: instances, where they are many;  frame: the
    coordinates of all these, lengths of pieces and solids included."""

    mi_scene: Any
    pieces: Mapping[str, Piece]
    solids: tuple[SolidTwin, ...] = ()
    crowd: Crowd | None = None
    frame: Frame = OURS

    def sensors(self) -> Any:
        """Mitsuba's sensors."""
        return self.mi_scene.sensors()

    @property
    def lacking(self) -> str:
        """Why light cannot be compared; empty where it can."""
        if self.solids:
            return (
                "Mitsuba has no set operations: what rays hit is found from its hits of each "
                "operand, but its integrators see no solids"
            )
        if self.crowd is not None:
            return (
                f"{len(self.crowd.pieces)} instances: Mitsuba's integrators take minutes to "
                "compile for more than a few"
            )
        return ""

    def notes(self) -> list[str]:
        """What a reader should know of what stands for what."""
        return self._moved() + [
            f"a mesh of {s.triangles:,} triangles stands in for shape {shape} ({s.name}), within "
            f"{s.sag:.2g} of it; {s.ratio:.2g} times more at half the fineness"
            for shape, found in self.stand_ins().items()
            for s in dict.fromkeys(found)
        ]

    def _moved(self) -> list[str]:
        if self.frame.is_ours:
            return []
        middle = ", ".join(f"{x:.6g}" for x in self.frame.center)
        return [
            f"Mitsuba sees the scene moved by minus ({middle}) and {self.frame.scale:.6g} times as "
            "large: where it is, rays would begin further off surfaces than a hundredth of its size"
        ]

    def all_pieces(self) -> list[Piece]:
        """Everything that stands for something, operands of solids included."""
        found = list(self.pieces.values())
        if self.crowd is not None:
            found += self.crowd.pieces.values()
        for solid in self.solids:
            for operand in solid.operands:
                found += operand.pieces.values()
        return found

    def extents(self) -> dict[int, Extent]:
        """What there is of infinite planes, by the index of the shape."""
        return {
            p.shape: Extent(
                self.frame.out(p.plugin.extent.middle), p.plugin.extent.radius / self.frame.scale
            )
            for p in self.pieces.values()
            if p.plugin.extent
        }

    def stand_ins(self) -> dict[int, list[StandIn]]:
        """The meshes that stand for something else, by the index of the shape."""
        found: dict[int, list[StandIn]] = {}
        for piece in self.all_pieces():
            if piece.plugin.stand_in is not None:
                one = piece.plugin.stand_in
                one = one._replace(sag=one.sag / self.frame.scale)
                found.setdefault(piece.shape, []).append(one)
        return found


def trace(twin: Twin, o: FloatArray, d: FloatArray, tolerance: float = SLIGHT) -> Answers:
    """What Mitsuba hits first, in the same record as `reference_rt.query.intersect` returns.

    Mitsuba sees the rays in the twin's frame and rounded to float32.  `tolerance`: see
    `SolidTwin.trace`.
    """
    if twin.frame.is_ours:
        return _trace(twin, o, d, tolerance)
    found = _trace(twin, twin.frame.into(o), d, tolerance)
    scale = twin.frame.scale
    met = found.shape >= 0
    found.p[met] = twin.frame.out(found.p[met])
    return replace(found, t=found.t / scale, sag=found.sag / scale)


def _trace(twin: Twin, o: FloatArray, d: FloatArray, tolerance: float) -> Answers:
    """The same in the twin's coordinates."""
    found = _hits(twin.mi_scene, twin.pieces, o, d)
    everything = np.arange(len(o))
    if twin.crowd is not None and len(o) > 0:
        with scalar():
            put_nearer(found, everything, _hits(twin.crowd.mi_scene, twin.crowd.pieces, o, d))
    for solid in twin.solids:
        near = solid.near(o, d)
        if len(near) == 0:
            continue
        put_nearer(found, near, solid.trace(o[near], d[near], tolerance))
    return found


def _hits(mi_scene: Any, pieces: Mapping[str, Piece], o: FloatArray, d: FloatArray) -> Answers:
    if not pieces or len(o) == 0:  # Dr.Jit takes no empty arrays
        return nothing(len(o))
    ids = {name: k for k, name in enumerate(pieces)}
    return read(first_hits(mi_scene, ids, o, d), list(pieces.values()), o)

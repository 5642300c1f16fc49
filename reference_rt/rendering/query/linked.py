"""A scene's tables behind links, as the kernels of queries take them (see `jit/links.py`).

Linked kernels are compiled once for all scenes.  Specialised ones, with everything inlined, take 3
to 6 s to compile for each kind of scene and save 0 to 35 ns a ray of 50 to 450 (measured): that
pays after 10^8 rays, so queries have none.
"""

import os
import threading
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numba

from reference_rt.accel.geometry import Geometry
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.links import Link, Linker
from reference_rt.jit.parallel_compile import precompile_all
from reference_rt.rendering.linking import linked_geometry, linked_scene, linked_shapes

SCENES = 4
"""Scenes whose links are kept: to make them takes some milliseconds, and keeps the scene in
memory."""


class Linked:
    """Tables behind links, which are valid as long as this object lives."""

    def __init__(self, tables: Any, linker: Linker | None) -> None:
        self.tables, self._linker = tables, linker


_lock = threading.Lock()

_kept: dict[int, tuple[SceneTables, dict[Any, Linked]]] = {}
"""Scenes and their links by purpose, the oldest scene first.  The keys are the identities of the
scenes, which are kept so that no other scene can have the same."""


def linked(
    scene: SceneTables, purpose: Any, link: Callable[[Linker], Any], unlinked: Any
) -> Linked:
    """What `link` makes of the scene, with all its operations compiled: once for each purpose.
    Plain Python links nothing and gets the tables `unlinked`."""
    if numba.config.DISABLE_JIT:
        return Linked(unlinked, None)
    of_scene = _kept.get(id(scene))
    if of_scene is not None and purpose in of_scene[1]:
        return of_scene[1][purpose]
    with _lock:
        _, links = _kept.setdefault(id(scene), (scene, {}))
        if purpose not in links:
            linker = Linker()
            tables = link(linker)
            precompile_all([*linker.calls], os.cpu_count() or 1)
            linker.resolve()
            links[purpose] = Linked(tables, linker)
        while len(_kept) > SCENES:
            del _kept[next(iter(_kept))]
        return links[purpose]


def link_to_geometry(scene: SceneTables, *operations: str) -> Linked:
    """The scene's geometry behind a link that has these operations."""
    geometry = scene.geometry
    return linked(scene, operations, lambda made: geometry_of(made, geometry, operations), geometry)


def geometry_of(linker: Linker, geometry: Geometry, operations: Sequence[str]) -> Link:
    """A geometry behind a link that has these operations, and what they call."""
    shapes = linked_shapes(linker, geometry.shapes, _of_shapes(geometry, operations))
    return linked_geometry(linker, geometry, shapes, operations)


def link_to_scene(scene: SceneTables, integrator: str) -> Linked:
    """The scene as the kernels of an integrator take it: see `linking.linked_scene`."""
    return linked(scene, integrator, lambda made: linked_scene(made, scene, integrator), scene)


_ONE_RAY, _MANY_RAYS = {"closest_hit", "occluded"}, {"closest_hits", "any_hits"}
_CROSSINGS = {"next_crossing", "crossings_of_solid"}


def _of_shapes(geometry: Geometry, operations: Iterable[str]) -> set[str]:
    """The operations on shapes that operations on a geometry call."""
    wanted, asked = set(), set(operations)
    if asked & (_ONE_RAY | _MANY_RAYS) and geometry.bvh is not None:
        wanted |= {"intersect", "owner", "face"}
    elif asked & _MANY_RAYS:
        wanted |= {"nearest_of_block", "complete_block"}
    elif asked & _ONE_RAY:
        wanted |= {"nearest_of_type"}
    if asked & _CROSSINGS:
        wanted |= {"intersect", "spans", "_of_quadric", "primitive_count", "owner", "face"}
    if "surface" in asked:
        wanted |= {"surface"}
    if "owner" in asked:
        wanted |= {"owner", "face"}
    if "coordinates" in asked:
        wanted |= {"uv", "colour"}
    if geometry.parts is not None:
        wanted |= {"owner"}
    if geometry.solids is not None:
        wanted |= {"intersect", "surface", "spans", "enters", "owner", "face"}
    return wanted

"""A scene's tables behind links, as the kernels of queries take them (see `jit/links.py`)."""

import os
import threading
from collections.abc import Callable
from typing import Any

from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.links import Linker
from reference_rt.jit.parallel_compile import precompile_all
from reference_rt.rendering.linking import calls_of, geometry_of, linked_scene

SCENES = 4
"""Scenes whose links are kept: to make them takes some milliseconds, and keeps the scene in
memory."""


class Linked:
    """Tables behind links, which are valid as long as this object lives."""

    def __init__(self, tables: Any, linker: Linker) -> None:
        self.tables, self._linker = tables, linker


_lock = threading.Lock()

_kept: dict[int, tuple[SceneTables, dict[Any, Linked]]] = {}
"""Scenes and their links by purpose, the oldest scene first.  The keys are the identities of the
scenes, which are kept so that no other scene can have the same."""


def linked(scene: SceneTables, purpose: Any, link: Callable[[Linker], Any]) -> Linked:
    """What `link` makes of the scene, with all its operations compiled: once for each purpose."""
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
    return linked(scene, operations, lambda made: geometry_of(made, geometry, operations))


def link_to_scene(scene: SceneTables, kernel: Any) -> Linked:
    """The scene as a kernel takes it."""
    return linked(scene, kernel, lambda made: linked_scene(made, scene, calls_of(kernel)))

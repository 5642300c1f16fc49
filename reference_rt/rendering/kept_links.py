"""A scene's tables behind links, as kernels take them (see `jit/links.py`), made once."""

import os
import threading
from collections.abc import Callable
from typing import Any

from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.links import Linker
from reference_rt.jit.parallel_compile import precompile_all
from reference_rt.rendering.linking import calls_of, geometry_of, linked_scene


class Linked:
    """Tables behind links, which are valid as long as this object lives."""

    def __init__(self, tables: Any, linker: Linker) -> None:
        self.tables, self._linker = tables, linker


_lock = threading.Lock()


def _compile_for(linker: Linker) -> None:
    precompile_all(linker.missing, os.cpu_count() or 1)


def linked(
    scene: SceneTables,
    purpose: Any,
    link: Callable[[Linker], Any],
    compile_for: Callable[[Linker], Any] = _compile_for,
) -> Linked:
    """What `link` makes of the scene, with all its operations compiled: once for each purpose."""
    if purpose not in scene.links:
        with _lock:
            if purpose not in scene.links:
                linker = Linker()
                tables = link(linker)
                compile_for(linker)
                linker.resolve()
                scene.links[purpose] = Linked(tables, linker)
    found: Linked = scene.links[purpose]
    return found


def link_to_geometry(scene: SceneTables, *operations: str) -> Linked:
    """The scene's geometry behind a link that has these operations."""
    geometry = scene.geometry
    return linked(scene, operations, lambda made: geometry_of(made, geometry, operations))


def link_to_scene(scene: SceneTables, kernel: Any) -> Linked:
    """The scene as a kernel takes it."""
    return linked(scene, kernel, lambda made: linked_scene(made, scene, calls_of(kernel)))

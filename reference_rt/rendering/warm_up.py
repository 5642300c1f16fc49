"""The finite set of all linked kernels, to be compiled ahead of time.

Linked kernels (`kernels.py`) are compiled for types of tables, not for scenes, so that a few small
scenes which together have every type reach all of them (`warm_up_scenes.py`).  These scenes are
never rendered: their tables are linked, and what the linker asks for is collected.  To build the
tables compiles the few kernels that build hierarchies and light trees.

To add kernels of another kind, such as those of a query: a function that returns the calls of one
scene, and its place in `_CALLS`.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from reference_rt.integrators import Direct, RayCast, Whitted
from reference_rt.integrators import Path as PathTracing
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.parallel_compile import Call
from reference_rt.rendering.accumulation import Job, jobs_of
from reference_rt.rendering.compile_cost import cost, operation_of
from reference_rt.rendering.kernels import Linked, Specialised
from reference_rt.rendering.query.ahead import query_calls
from reference_rt.rendering.warm_up_scenes import scenes
from reference_rt.sampling import Grid
from reference_rt.scene.build import BuiltScene
from reference_rt.shapes.meshes.files.obj_scanner import scan_call


def picture_calls(scene: BuiltScene) -> list[Call]:
    """The linked kernels of a scene's picture."""
    return Linked(*_picture(scene)).calls


def specialised_calls(scene: BuiltScene) -> list[Call]:
    """The specialised kernels of a scene's picture."""
    return Specialised(*_picture(scene)).calls


def _picture(scene: BuiltScene) -> tuple[list[Job], SceneTables, Any, Any]:
    # Of one pixel: the number of pixels changes no type.
    film = scene.film.model_copy(update={"width": 1, "height": 1})
    jobs = jobs_of(scene.model_copy(update={"film": film}))
    return jobs, scene.tables, scene.camera.setup(1, 1), film.filter.setup()


_INTEGRATORS = PathTracing(), Direct(), Whitted(), RayCast()


def _pictures(scene: BuiltScene) -> Iterator[Call]:
    """The linked kernels of its pictures by all integrators, with its sampler where that fits."""
    for integrator in _INTEGRATORS:
        fits = integrator.deterministic or not isinstance(scene.sampler, Grid)
        changes = {"integrator": integrator, "sampler": scene.sampler if fits else None}
        yield from picture_calls(scene.model_copy(update=changes))


_CALLS: tuple[Callable[[BuiltScene], Iterable[Call]], ...] = (_pictures, query_calls)
"""From a scene to the linked kernels that some work on it needs."""


def linked_calls() -> list[Call]:
    """All linked kernels and the scanner of .obj files, without duplicates, those that take longest
    to compile first."""
    found: dict[Call, None] = {scan_call(): None}
    for scene in scenes():
        for calls in _CALLS:
            found |= dict.fromkeys(calls(scene))
    return sorted(found, key=cost, reverse=True)


__all__ = ["cost", "linked_calls", "operation_of", "picture_calls", "specialised_calls"]

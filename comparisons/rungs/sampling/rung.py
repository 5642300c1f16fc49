"""The rung `sampling` of a scene: the parts that its integrator uses, in order."""

from collections.abc import Callable
from typing import Any

from comparisons.results.case import RungResult
from comparisons.rungs.sampling import lights, materials, media, roulette
from reference_rt.integrators import Direct, Path, RayCast, Whitted
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering.scene import Scene


def sampling(scene: Scene, tables: SceneTables) -> RungResult:
    """Check the samples that the scene's integrator draws; the first part that fails is reported.

    Raises SceneError.
    """
    integrator = scene.integrator
    if isinstance(integrator, RayCast | Whitted):
        reason = f"{integrator.type} draws no samples of lights or materials"
        return RungResult("sampling", "not-applicable", reason)
    parts: list[Callable[[], RungResult]] = [lambda: lights.check(scene, tables)]
    if isinstance(integrator, Direct) and not integrator.follows_scattered:
        left_out = "; direct samples no materials here"
    else:
        left_out = ""
        parts.append(lambda: materials.check(scene, tables))
    if isinstance(integrator, Path):
        parts.append(roulette.check)
    if scene.media:
        parts.append(lambda: media.check(scene))
    found: list[RungResult] = []
    for part in parts:
        found.append(part())
        if found[-1].status == "differ":
            return found[-1]
    numbers: dict[str, Any] = {}
    for result in found:
        numbers |= result.numbers
    applied = any(result.status == "agree" for result in found)
    reason = "; ".join(result.reason for result in found) + left_out
    return RungResult("sampling", "agree" if applied else "not-applicable", reason, numbers)

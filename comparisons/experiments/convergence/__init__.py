"""Error against run time: ours and Mitsuba's, sample for sample and second for second."""

from typing import TYPE_CHECKING

from reference_rt.rendering.scene import Scene

if TYPE_CHECKING:
    from comparisons.experiments.convergence.findings import Target

METHODS = ("ours", "mitsuba_llvm", "mitsuba_llvm_best", "mitsuba_scalar")

NARROW = 64
"""Pixels across of pictures for a quick answer."""


def time_to_error(scene: Scene, target: float, seconds: float) -> dict[str, float]:
    """Render seconds until the relative error, the root of relMSE, is `target`, by method: the
    values of `reached`, which also says how they are known."""
    found = reached(scene, target, seconds)
    return {name: one.seconds.value for name, one in found.items()}


def reached(scene: Scene, target: float, seconds: float) -> "dict[str, Target]":
    """When the relative error, the root of relMSE, is `target`, by method.

    scene: of a random integrator; rendered through a box filter and at most 64 pixels wide, where
    a short budget still reaches high rungs (times grow with the pixels, ratios do not);  seconds:
    budget for all methods together, after kernels are compiled.  Methods:
    "ours", "mitsuba_llvm", "mitsuba_llvm_best" (its best sampler), "mitsuba_scalar"; one that
    cannot render the scene, or not within the budget, is absent; one with a proven bias above the
    target takes infinitely long.  Times are medians of warm renders on all cores, read off the
    measured ladder of samples, or off its fit where the target lies beyond ("extrapolated").

    Raises SceneError, ReferenceUnavailableError; ValueError for a deterministic scene.
    """
    # Imported here: the package's name is imported by its modules too.
    from comparisons.experiments.convergence.data import Settings, size_within
    from comparisons.experiments.convergence.run import converge

    if scene.integrator.deterministic:
        raise ValueError(f"{scene.name}: is deterministic; expected an integrator with chance")
    settings = Settings(
        time_limit=seconds,
        size=size_within(scene.film, NARROW),
        targets=(target,),
        only=METHODS,
        starts=False,
        crops=False,
    )
    found = converge(scene, settings).findings
    times = {name: found[name].targets[0] for name in METHODS if name in found}
    return {name: one for name, one in times.items() if one.how != "unknown"}


__all__ = ["reached", "time_to_error"]

"""`reference-rt converge`: error against run time, of our renderer and Mitsuba's.

A method under test (`methods`) is a renderer with one sampler.  A rung is a number of samples per
pixel; the ladder renders replicates at each rung, the methods taking turns.  `estimates`
and `findings` turn rungs into errors, slopes, bias and times to a target error; `store`
keeps finished rungs; `outputs` and `page` show the `Curves`.

Errors are relMSE, or its square root, the relative error; times are seconds of warm renders on all
cores.  Deterministic scenes have `Grids` instead of a ladder.

To add a method, add it to `methods.METHODS`; if its renderer is another one, `methods.Stable.ready`
must return a function (samples per pixel, replicate) -> `Shot` for it.
"""

from typing import TYPE_CHECKING

from reference_rt.rendering.scene import Scene

if TYPE_CHECKING:
    from comparisons.experiments.convergence.findings import Target

METHODS = ("ours", "mitsuba_llvm", "mitsuba_llvm_best", "mitsuba_scalar", "cycles")

NARROW = 64
"""Width in pixels of pictures for a quick answer."""


def reached(scene: Scene, target: float, seconds: float) -> "dict[str, Target]":
    """The time to the relative error `target` (the square root of relMSE), by method.

    scene: with a random integrator; rendered with a box filter and at most 64 pixels wide, so that
    a short budget reaches high rungs (times grow with the pixels, ratios do not);  seconds: time
    budget of all methods together, without compilation.  Methods: "ours", "mitsuba_llvm",
    "mitsuba_llvm_best" (its best sampler), "mitsuba_scalar", "cycles".  A method that cannot render
    the scene, or not within the budget, is absent; the time of one with a proven bias above the
    target is infinite.  Times are medians of warm renders on all cores, interpolated between rungs,
    or "extrapolated" by a fit beyond the last rung.

    Raises SceneError, ReferenceUnavailableError; ValueError for a deterministic scene.
    """
    # Imported here: the package's name is imported by its modules too.
    from comparisons.experiments.convergence.run import converge
    from comparisons.experiments.convergence.store import Settings, size_within

    if scene.integrator.deterministic:
        raise ValueError(f"{scene.name}: is deterministic; expected a random integrator")
    settings = Settings(
        time_limit=seconds,
        size=size_within(scene.film, NARROW),
        targets=(target,),
        only=METHODS,
        crops=False,
    )
    found = converge(scene, settings).findings
    times = {name: found[name].targets[0] for name in METHODS if name in found}
    return {name: one for name, one in times.items() if one.how != "unknown"}

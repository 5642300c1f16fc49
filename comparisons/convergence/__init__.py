"""Error against run time: ours and Mitsuba's, sample for sample and second for second."""

from reference_rt.scene import Scene


def time_to_error(scene: Scene, target: float, seconds: float) -> dict[str, float]:
    """Render seconds until the relative error, the root of relMSE, is `target`, by contestant.

    scene: of a random integrator; rendered through a box filter and at most 128 pixels wide;
    seconds: budget for all contestants together, after kernels are compiled.  Contestants:
    "ours", "mitsuba_llvm", "mitsuba_llvm_best" (its best sampler), "mitsuba_scalar"; one that
    cannot render the scene, or not within the budget, is absent.  Times are medians of warm renders
    on all cores, read off the measured ladder of samples, or off its fit where the target lies
    beyond.

    Raises SceneError, ReferenceUnavailableError; ValueError for a deterministic scene.
    """
    raise NotImplementedError


__all__ = ["time_to_error"]

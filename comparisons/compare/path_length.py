"""Hypotheses about the length of paths: renderers count edges, bounces or vertices, from 0 or 1.

Light that is lost at the end of paths looks like a gain, since it is similar to the light that is
left. The scene is known, so it is rendered with the lengths that a wrong convention would give; the
change is what the candidate should show. Both pictures have the same random numbers, and therefore
the same noise but for that of the paths that one of them lacks.
"""

from collections.abc import Callable, Iterator

from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.compare.diagnosis.misfit import REST
from comparisons.compare.media_mistakes import media_mistakes
from comparisons.compare.mistaken_paths import mistaken_paths
from comparisons.results.case import FloatArray
from reference_rt.integrators import Direct, Path, Whitted
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene

SAMPLES = 1 << 20
"""Camera samples of each picture, about a second: the change of a bounce is then known to a
hundredth in the mean of the picture."""

DIRECT = 2
"""`max_depth` in edges of direct light alone."""

USUAL = (DIRECT, 3, 4, 5, 6, 8)
"""Lengths that a scene without a limit is compared with."""

Lengths = Callable[[FloatArray], Iterator[Hypothesis]]
"""Yields hypotheses about a reference (height, width, 3); renders them."""


def path_lengths(scene: Scene, threads: int | None = None) -> Lengths | None:
    """Hypotheses about a scene, of path tracing alone, and of mistakes on its paths; None where it
    has none."""
    own = scene.integrator
    if isinstance(own, Direct | Whitted):
        return lambda reference: mistaken_paths(scene, reference, threads)
    if not isinstance(own, Path):
        return None

    def hypotheses(reference: FloatArray) -> Iterator[Hypothesis]:
        pixels = scene.film.width * scene.film.height
        spp = 1 << max(0, (SAMPLES // pixels).bit_length() - 1)
        sampler = scene.resolved_sampler.model_copy(update={"spp": spp})
        right = _picture(scene, own.max_depth, sampler, threads)
        for length, name in _others(own.max_depth):
            change = _picture(scene, length, sampler, threads) - right
            if change.shape != reference.shape or not change.any():
                continue
            had = "no limit" if own.max_depth is None else f"max_depth {own.max_depth}"
            other = "without a limit" if length is None else f"with max_depth {length}"
            evidence = f"so does our picture change if rendered {other}; the scene has {had}"
            yield Hypothesis("path length", name, evidence, reference + change, 0, REST)
        mistakes = media_mistakes if scene.has_media else mistaken_paths
        yield from mistakes(scene, reference, threads)

    return hypotheses


def _others(own: int | None) -> Iterator[tuple[int | None, str]]:
    """Other values of `max_depth`, and what a renderer with each does."""
    if own is None:
        for length in USUAL:
            yield (
                length,
                "direct light alone" if length == DIRECT else f"paths end at edge {length}",
            )
        return
    if own > 0:
        yield own - 1, "paths are one edge too short"
    yield own + 1, "paths are one edge too long"
    if own - 1 > DIRECT:
        yield DIRECT, "direct light alone"
    yield None, "paths have no limit"


def _picture(scene: Scene, length: int | None, sampler: object, threads: int | None) -> FloatArray:
    integrator = scene.integrator.model_copy(update={"max_depth": length})
    return render(scene.changed(integrator=integrator, sampler=sampler), threads=threads).colour

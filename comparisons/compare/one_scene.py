"""`comparisons.compare(scene)`: one scene against Mitsuba, from Python."""

import logging
import os
from collections.abc import Callable

from comparisons.compare.budget import Budget, usual
from comparisons.compare.compare import Subject, compare_scene
from comparisons.compare.looks import SECONDS
from comparisons.compare.notebook import NotebookCase
from comparisons.mitsuba.backend import mitsuba
from comparisons.renderers import Witnesses
from reference_rt.rendering.render import with_settings
from reference_rt.rendering.scene import Scene

_LOG = logging.getLogger(__name__)


def compare_one(
    scene: Scene | str | os.PathLike[str],
    *,
    spp: int | None = None,
    size: tuple[int, int] | None = None,
    seed: int | None = None,
    replicates: int | None = None,
    time_limit: float | None = SECONDS,
    limit: float = Budget().limit,
    threads: int | None = None,
    witness: Witnesses = None,
    say: Callable[[str], None] | None = None,
) -> NotebookCase:
    """Render a scene, or a scene file, by reference_rt and by Mitsuba, and judge the difference.

    spp: samples per pixel of each picture, None for a part of the scene's.  size, seed: None for
    the scene's own.  replicates: independent pictures by each renderer at the first look, None for
    as many as the noise asks for; others are added until the question is decided or `time_limit`
    seconds have passed; None: one look.  limit: the smallest relative bias of the image mean that
    must be detectable.  threads: ours, None for all cores.  witness: another renderer, or
    several, whose pictures say who stands alone.  say: called with a line about each step;
    by default these go to the logger of this module, as information.

    Mitsuba runs in this process.  Raises SceneError, ReferenceUnavailableError.
    """
    loaded = scene if isinstance(scene, Scene) else Scene.load(os.fspath(scene))
    loaded = with_settings(loaded, spp=spp, size=size, seed=seed)
    mitsuba()
    budget = usual(
        spp,
        replicates,
        SECONDS if time_limit is None else time_limit,
        fixed=time_limit is None,
        limit=limit,
        witness=witness,
    )
    case = compare_scene(Subject(loaded), budget, say or _LOG.info, threads)
    _LOG.info("%s: %s: %s", case.scene, case.verdict, case.reason)
    return NotebookCase.of(case)

"""The convergence of a scene's file, with a store: a task for workers."""

from pathlib import Path

from comparisons.experiments.convergence.curves import Curves
from comparisons.experiments.convergence.data import Settings
from comparisons.experiments.convergence.run import converge, prepared, silent
from comparisons.experiments.convergence.store import Store, run_key
from comparisons.suites.work import Changes, read
from reference_rt.rendering.render import Progress
from reference_rt.util.errors import SceneError

INVALID = "invalid: "
"""What the problem of curves begins with if the scene is invalid."""


def curves_of(
    path: Path,
    changes: Changes,
    settings: Settings,
    folder: Path,
    fresh: bool,
    say: Progress = silent,
) -> Curves:
    """The curves of one scene;  folder: where its rungs are stored, and found by the next run.
    Raises as `converge`, but an invalid scene has curves that say so."""
    try:
        scene = read(path, changes.on(path))
        if isinstance(scene, SceneError):
            raise scene
        key = run_key(prepared(scene, settings), settings.replicates)
        return converge(scene, settings, Store(folder, key, fresh=fresh), say)
    except SceneError as error:  # the other scenes have curves all the same
        return Curves(path.stem, problem=f"{INVALID}{error}")

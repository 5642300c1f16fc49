"""`render`: from a scene, or a scene's file, to a picture."""

import math
import os
from pathlib import Path

from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.parallel_compile import Report
from reference_rt.rendering.executor import Remote
from reference_rt.rendering.loop import Limits
from reference_rt.rendering.picture import Picture
from reference_rt.rendering.session import Session, Storage
from reference_rt.rendering.settings import with_settings
from reference_rt.rendering.thread_pool import Progress
from reference_rt.scene.build import BuiltScene
from reference_rt.util.workers import Processes


def render(
    scene: BuiltScene | str | os.PathLike[str],
    *,
    spp: int | None = None,
    size: tuple[int, int] | None = None,
    seed: int | None = None,
    threads: int | None = None,
    tables: SceneTables | None = None,
    progress: Progress | None = None,
    compiling: Report | None = None,
    specialised: bool | None = None,
    time_limit: float | None = None,
    target_error: float | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    workers: int | None = None,
) -> Picture:
    """Render a scene, or a scene file.

    spp: samples per pixel;  size: width and height in pixels;  seed: of the random numbers; None:
    the scene's own.  threads: default all cores; their number changes no bit.  tables: the scene's
    tables, if they are built already.  progress: called as the render goes on;  compiling: called
    in its place while kernels are compiled, with the number of those that are, and of all.
    specialised: whether kernels are compiled for this kind of scene, for the highest speed, or
    linked; None: see `kernels`; no bit changes.  Ctrl-C stops it within a tile.

    time_limit: seconds after which it ends, with the samples that there are by then;
    target_error: relative standard error (see `noise`) at which it ends;  checkpoint: a folder
    where it is stored as it goes on: a render that was ended goes on there.  workers: processes to
    compute it, of one thread each, in place of threads of this one; they change no bit.

    Raises SceneError, UsageError, WorkersError; issues a SceneWarning for each of
    `likely_mistakes`.
    """
    say = progress or (lambda what, fraction: None)
    if not isinstance(scene, BuiltScene):
        scene = BuiltScene.load(os.fspath(scene))
    if (spp, size, seed) != (None, None, None):
        scene = with_settings(scene, spp=spp, size=size, seed=seed)
    limits = Limits(math.inf if time_limit is None else time_limit, target_error or 0.0)
    with Session(
        scene,
        threads=threads,
        tables=tables,
        compiling=compiling or (lambda done, total: say("compile", done / total)),
        specialised=specialised,
        limits=limits,
        workers=None if workers is None else lambda found: Remote(found, Processes(workers)),
        storage=None if checkpoint is None else Storage(Path(checkpoint)),
        at_once=limits == Limits() and checkpoint is None,
    ) as session:
        say("compile", 1.0)
        session.run(say)
        return session.picture()


__all__ = ["Picture", "Progress", "render"]

"""Options of commands: the scene that one is about and what changes it; what ends a render early or
lets it go on later."""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from reference_rt.cli.quantities import size_of
from reference_rt.util.errors import SceneError, UsageError
from reference_rt.util.workers import Workers

if TYPE_CHECKING:
    from reference_rt.rendering.scene import Scene

# ---- `-D name=value`: values for a scene of another program, whose format has such defaults ------


Defaults = Annotated[
    list[str] | None,
    typer.Option(
        "-D",
        metavar="NAME=VALUE",
        help="A value for a <default> of a Mitsuba scene; of glTF: camera, scene, environment (a "
        "file or a radiance); repeatable.",
    ),
]

Size = Annotated[str | None, typer.Option(help="WIDTHxHEIGHT in pixels.")]

IntegratorName = Annotated[str | None, typer.Option(help="ray_cast, whitted, direct or path.")]

Seed = Annotated[int | None, typer.Option(help="Seed of the random numbers.")]

AllowMissing = Annotated[
    bool,
    typer.Option(
        "--allow-missing",
        help="Leave out or replace what of an .xml, .gltf or .glb scene is not supported.",
    ),
]


def by_name(given: Sequence[str] | None) -> dict[str, str]:
    """The values by name.  Raises UsageError."""
    found: dict[str, str] = {}
    for text in given or ():
        name, equals, value = text.partition("=")
        if not name or not equals:
            raise UsageError(f"-D: expected NAME=VALUE, such as spp=64, got '{text}'")
        if name in found:
            raise UsageError(f"-D: '{name}' is given twice; expected one value")
        found[name] = value
    return found


SceneArgument = Annotated[
    Path,
    typer.Argument(
        metavar="SCENE", help="A .yaml or .json scene, a glTF one, or a Mitsuba .xml one."
    ),
]

_OPTIONS = (("spp",), ("size",), ("integrator",), ("seed",))
"""Settings that errors of `with_settings` name."""


def adjusted(
    scene: "Scene",
    spp: int | None = None,
    size: str | None = None,
    integrator: str | None = None,
    seed: int | None = None,
) -> "Scene":
    """The scene with the options of the command line.  Raises UsageError."""
    from reference_rt.rendering.render import with_settings

    pixels = None if size is None else size_of(size)
    try:
        return with_settings(scene, spp=spp, size=pixels, integrator=integrator, seed=seed)
    except SceneError as error:
        if error.path in _OPTIONS:
            raise UsageError(f"--{error.path[0]}: {error.message}") from None
        raise


@contextmanager
def without_blas() -> Iterator[None]:
    """Stop Numba from importing SciPy with its first kernel to look for BLAS: 0.1 s for a feature
    that no kernel of ours uses."""
    name = "scipy.linalg.cython_blas"
    absent = name not in sys.modules
    if absent:
        sys.modules[name] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        if absent:
            del sys.modules[name]


# ---- where tasks are computed, as the options of a command say -----------------------------------


class Where(NamedTuple):
    """The options --workers, --scheduler, --cluster and --threads, of which one may be given."""

    workers: int | None = None
    scheduler: str | None = None
    cluster: Path | None = None
    threads: int | None = None

    @property
    def is_elsewhere(self) -> bool:
        """Whether other processes or machines compute."""
        return (self.workers, self.scheduler, self.cluster) != (None, None, None)

    @property
    def is_cluster(self) -> bool:
        """Whether the workers are those of a scheduler."""
        return (self.scheduler, self.cluster) != (None, None)

    def check(self) -> None:
        """Raise UsageError if two of them are given."""
        given = [name for name, value in self._asdict().items() if value is not None]
        if len(given) > 1:
            listed = " and ".join(f"--{name}" for name in given)
            raise UsageError(f"{listed} contradict each other; expected one of them")

    def open(self, local: Callable[[int], Workers], default: int = 1) -> Workers:
        """The workers; close them at the end.

        local: makes so many workers on this machine;  default: their number without --workers.
        Raises UsageError, WorkersError.
        """
        self.check()
        if not self.is_cluster:
            return local(self.workers or default)
        from reference_rt.util.cluster import Cluster

        return Cluster(self.scheduler or "", self.cluster)


def duration(words: str, default: str = "") -> Any:
    """An option that is a duration: its text, which `seconds_of` reads; words: its help."""
    unless = f" (default: {default})" if default else ""
    return typer.Option(metavar="TIME", help=f"{words}: 90s, 10m or 1.5h.{unless}")


TimeLimit = Annotated[str | None, duration("End after this time, with the samples so far")]
TargetError = Annotated[
    str | None,
    typer.Option(help="End at this relative standard error of the picture, such as 1%."),
]
CheckpointFolder = Annotated[
    Path | None,
    typer.Option(
        "--checkpoint",
        help="A folder to store the render in as it goes on; one that was ended goes on there. "
        "Default: in the cache, for renders of more than a minute.",
    ),
]
NoCheckpoint = Annotated[bool, typer.Option("--no-checkpoint", help="Store nothing meanwhile.")]
Resume = Annotated[
    bool, typer.Option("--resume", help="Go on with the stored render of these settings.")
]
MoreSpp = Annotated[
    int | None,
    typer.Option(min=1, help="Add so many samples per pixel to the stored render."),
]
Preview = Annotated[
    Path | None,
    typer.Option(help="An .exr or .png file, rewritten now and then with the picture so far."),
]
Memory = Annotated[
    str | None,
    typer.Option(help="Memory that may be used, such as 2G; what does not fit is on disk."),
]
NumberOfWorkers = Annotated[
    int | None,
    typer.Option("--workers", min=1, help="Processes of one thread each, in place of threads."),
]
Scheduler = Annotated[
    str | None,
    typer.Option(help="The workers of the Dask scheduler at this address: tcp://HOST:8786."),
]
ClusterFile = Annotated[
    Path | None,
    typer.Option("--cluster", help="Workers of a batch system: a .yaml file, see docs/scale.md."),
]

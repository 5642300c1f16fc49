"""Options of commands: the scene that one is about and what changes it; what ends a render early or
lets it go on later."""

import math
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

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


# ---- quantities of the command line: sizes, durations, numbers of bytes, percentages -------------


_SECONDS = {"s": 1.0, "m": 60.0, "h": 3600.0, "d": 86400.0}
_BYTES = {"K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}
_NUMBER = re.compile(r"(\d+\.?\d*|\.\d+)\s*([a-zA-Z%]*)", re.ASCII)
_MOST_DIGITS = 30


def size_of(text: str) -> tuple[int, int]:
    """Width and height in pixels, as in 640x480.  Raises UsageError that names --size."""
    sides = text.lower().split("x")
    if len(sides) != 2 or not all(n.isdecimal() and len(n) < 11 for n in sides):
        raise UsageError(f"--size: expected WIDTHxHEIGHT, such as 640x480, got '{text}'")
    width, height = map(int, sides)
    if min(width, height) < 1:
        raise UsageError(f"--size: expected greater than or equal to 1, got '{text}'")
    return width, height


def seconds_of(text: str, option: str) -> float:
    """A duration, as in 90s, 10m, 1.5h, 2d.  Raises UsageError that names the option."""
    number, unit = _split(text)
    if math.isnan(number) or unit.lower() not in _SECONDS or number <= 0.0:
        raise UsageError(f"{option}: expected a duration, such as 90s, 10m or 1.5h, got '{text}'")
    return number * _SECONDS[unit.lower()]


def bytes_of(text: str, option: str) -> int:
    """A number of bytes, as in 500M or 2G.  Raises UsageError that names the option."""
    number, unit = _split(text)
    unit = unit.upper().removesuffix("B").removesuffix("I")
    if math.isnan(number) or unit not in _BYTES or number <= 0.0:
        raise UsageError(
            f"{option}: expected an amount of memory, such as 500M or 2G, got '{text}'"
        )
    return round(number * _BYTES[unit])


def share_of(text: str, option: str) -> float:
    """A share, as in 1% or 0.01.  Raises UsageError that names the option."""
    number, unit = _split(text)
    share = number / 100.0 if unit == "%" else number
    if math.isnan(number) or unit not in ("", "%") or not 0.0 < share < 1.0:
        raise UsageError(f"{option}: expected a share, such as 1% or 0.01, got '{text}'")
    return share


def duration(seconds: float) -> str:
    """A duration in words: 4.2 s, 3:07, 2:03:07."""
    if seconds < 60.0:
        return f"{seconds:.1f} s"
    whole = round(seconds)
    hours, minutes = whole // 3600, whole // 60 % 60
    if hours == 0:
        return f"{minutes}:{whole % 60:02}"
    return f"{hours}:{minutes:02}:{whole % 60:02}"


def percentage(share: float) -> str:
    """A share in words, with two significant digits: 3.1 %."""
    return f"{100.0 * share:.2g} %"


def _split(text: str) -> tuple[float, str]:
    """The number and the unit; nan where there is no number."""
    found = _NUMBER.fullmatch(text.strip()) if len(text) <= _MOST_DIGITS else None
    return (float(found[1]), found[2]) if found else (math.nan, "")


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


TimeLimit = Annotated[
    str | None,
    typer.Option(help="End after this time, such as 10m, with the samples so far."),
]
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

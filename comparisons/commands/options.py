"""Options that several commands have, with one help text each."""

from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from reference_rt.cli.options import ClusterFile as ClusterFile
from reference_rt.cli.options import Scheduler as Scheduler
from reference_rt.cli.options import duration
from reference_rt.util.errors import ReferenceUnavailableError, UsageError
from reference_rt.util.extras import needs

# ---- the message of a command whose Python packages, the extra `compare`, are not installed ------


@contextmanager
def compare_extra(doing: str = "comparing") -> Iterator[None]:
    """Wrap a command's own imports.  Raises ReferenceUnavailableError if a package is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise ReferenceUnavailableError(needs(doing, "compare", error.name)) from None


Baselines = Annotated[Path, typer.Option(metavar="DIR", help="The folder of baselines.")]

Fixed = Annotated[
    bool,
    typer.Option("--fixed", help="Make exactly --replicates, and look at them once."),
]

Fresh = Annotated[
    bool, typer.Option("--fresh", help="Ignore stored results and do everything again.")
]

GitHub = Annotated[
    bool,
    typer.Option(
        "--github", help="Write annotations and a step summary; automatic in GitHub Actions."
    ),
]

JUnit = Annotated[Path | None, typer.Option(metavar="FILE", help="Also write JUnit XML.")]

Layer = Annotated[
    str, typer.Option(help="Prefix of an EXR's channel names: 'beauty' for beauty.R.")
]

Limit = Annotated[
    float,
    typer.Option(help="Smallest relative bias of the image mean that must be detectable."),
]

NoiseFree = Annotated[
    bool,
    typer.Option("--noise-free", help="The candidates were rendered without random numbers."),
]

Scenes = Annotated[Path, typer.Option(metavar="DIR", help="The folder of scene files.")]

Threads = Annotated[int | None, typer.Option(min=1, help="Threads. (default: all cores)")]


NumberOfWorkers = Annotated[
    int | None,
    typer.Option("--workers", "--jobs", min=1, help="Processes at a time. (default: all cores)"),
]

Witness = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME",
        help="A third renderer, whose pictures say who stands alone: cycles or povray; repeatable.",
    ),
]

TimeLimit = Annotated[
    str | None, duration("Add no replicates beyond this time, for each scene", "10m")
]


def some_of(option: str, given: Iterable[str] | None, known: Collection[str]) -> tuple[str, ...]:
    """The names that are given, once each, or all.  Raises UsageError for one that is unknown."""
    names = tuple(dict.fromkeys(given or known))
    if unknown := [name for name in names if name not in known]:
        raise UsageError(f"{option}: expected one of {', '.join(known)}, got '{unknown[0]}'")
    return names


def out_folder(what: str, metavar: str | None = None) -> Any:
    """`--out`, the folder for `what`."""
    return typer.Option("--out", "-o", metavar=metavar, help=f"Folder for {what}.")


Plots = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Also write the plots as .svg files.")
]


def table_in(name: str) -> Any:
    """`--markdown`, a file in which the table between two comments is rewritten."""
    comments = f"'<!-- {name} -->' and '<!-- end -->'"
    return typer.Option(
        metavar="FILE", help=f"Also write the table between {comments} of this file."
    )

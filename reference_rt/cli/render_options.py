"""Options of `reference-rt render` that end it early or let it go on later."""

from pathlib import Path
from typing import Annotated

import typer

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

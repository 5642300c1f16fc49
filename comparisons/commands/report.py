"""`reference-rt report`."""

from pathlib import Path
from typing import Annotated

import typer

from comparisons.commands.extra import compare_extra
from reference_rt.cli import guarded, say


@guarded
def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="What a suite wrote to.")],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The page.  [default: DIR/report.html]")
    ] = None,
) -> None:
    """Write results.json and the page again, from the records of a suite."""
    with compare_extra():
        from comparisons.report import write_report, write_results
        from comparisons.suites.archive import read_archive

    archive = read_archive(folder)
    page = out or folder / "report.html"
    results = folder / "results.json"
    write_results(results, archive.cases, archive.provenance, archive.suite, archive.not_run)
    write_report(page, archive.cases, archive.provenance)
    say(f"{len(archive.cases)} cases: {results}, {page}", err=True)

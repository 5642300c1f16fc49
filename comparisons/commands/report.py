"""`reference-rt report`."""

from pathlib import Path
from typing import Annotated

import typer

from comparisons.commands.options import compare_extra
from reference_rt.cli.guarded import guarded, say


@guarded
def report(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="The output folder of `suite` or `compare`.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The page to write. (default: DIR/report.html)"),
    ] = None,
) -> None:
    """Write results.json and the page again, from the stored results of `suite` or `compare`.

    Exit code 1: cases are missing, because the run was interrupted.
    """
    with compare_extra():
        from comparisons.report import write_report, write_results
        from comparisons.results.case import how_many
        from comparisons.suites.run import check_stored_results, read_stored_results
    from reference_rt.util.files import check_writable

    page = out or folder / "report.html"
    results = folder / "results.json"
    check_stored_results(folder)
    check_writable(results, page)
    cases, provenance, suite, not_run, missing = read_stored_results(folder)
    write_results(results, cases, provenance, suite, not_run, missing)
    write_report(page, cases, provenance, missing=missing)
    say(f"{how_many(len(cases), len(missing))}: {results}, {page}", err=True)
    raise typer.Exit(1 if missing else 0)

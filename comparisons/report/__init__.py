"""Outputs of a run: `results.json` for machines, one offline HTML page for people, CI formats.

`page` writes the cases (`comparisons.results.case.Case`) of `compare`, `suite`
and `gate`; `ci` writes JUnit XML and GitHub annotations.  `table` (for terminals, documents and
pages), `templates` (which also writes tables into documents), `plots`, `thumbnails`, `values`,
`offline.html.jinja` and `macros.html.jinja` serve the experiments too.  Radiance is in W/sr/m²;
seconds are wall clock.

Every file is written whole or not at all.  Pages load nothing from the network, escape all text,
and show everything but interaction without JavaScript.  NaN and the infinities are null in JSON.

To add a number to the page, add it to a rung's `numbers`: the page and `results.json` show all of
them.  A new field of `Case` goes into `page.py`, `page.html.jinja` and `ci.py`.
"""

from comparisons.report.page import write_report, write_results

__all__ = ["write_report", "write_results"]

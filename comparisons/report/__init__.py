"""What a run found, written down: `results.json` for machines and one offline page for people."""

from comparisons.report.page import write_report
from comparisons.report.results_json import write_results

__all__ = ["write_report", "write_results"]

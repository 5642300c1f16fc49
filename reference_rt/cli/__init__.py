"""The command line `reference-rt`."""

from reference_rt.cli.main import main

__all__ = ["main"]

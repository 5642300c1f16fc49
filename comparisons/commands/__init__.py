"""The commands that `comparisons` adds to `reference-rt`, one to a file."""

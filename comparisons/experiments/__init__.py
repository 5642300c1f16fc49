"""Experiments: stability, convergence, benchmarks, intersection methods, and the harness's own
test."""

"""Geometry that comparing takes: exact arithmetic, float32, lengths and frames."""

"""Acceleration structures and the traversals that find what a ray hits."""

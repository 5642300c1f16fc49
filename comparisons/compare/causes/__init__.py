"""The likeliest cause of a difference, where it can be recognised."""

from comparisons.compare.causes.of_pictures import likeliest
from comparisons.compare.causes.of_rungs import of_rungs

__all__ = ["likeliest", "of_rungs"]

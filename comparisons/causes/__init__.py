"""The likeliest cause of a difference, where it can be recognised."""

from comparisons.causes.of_pictures import likeliest
from comparisons.causes.of_rungs import of_rungs

__all__ = ["likeliest", "of_rungs"]

"""The likeliest cause of a difference, where it can be recognised."""

from comparisons.compare.diagnosis.of_pictures import likeliest
from comparisons.compare.diagnosis.of_rungs import of_rungs

__all__ = ["likeliest", "of_rungs"]

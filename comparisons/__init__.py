"""Compares reference_rt with Mitsuba 3: translation, the rungs of comparison, verdicts, reports."""

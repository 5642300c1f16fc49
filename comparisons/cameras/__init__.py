"""Cameras for the comparison: to and from Mitsuba."""

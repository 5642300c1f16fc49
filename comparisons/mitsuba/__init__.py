"""Mitsuba: how it is loaded, scenes as it sees them, and what rays hit there."""

"""Textures for the comparison: to and from Mitsuba."""

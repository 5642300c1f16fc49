"""The comparison of one scene with Mitsuba, from its measurements to a verdict."""

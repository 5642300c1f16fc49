"""F5: every hierarchy finds what testing every primitive finds."""

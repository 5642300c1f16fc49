"""F13: surfaces that touch."""

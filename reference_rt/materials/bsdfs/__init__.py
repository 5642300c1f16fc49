"""The materials that scatter by a law of their own, one to a file."""

"""F4: thin triangles and needles."""

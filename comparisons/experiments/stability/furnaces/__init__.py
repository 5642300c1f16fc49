"""F10: furnaces, where every radiance is known."""

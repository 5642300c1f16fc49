"""F11: BSDFs: reciprocity, energy, densities."""

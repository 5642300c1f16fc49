"""F7: CSG solids."""

"""F9: scenes that are described differently and must look the same."""

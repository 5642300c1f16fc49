"""F1: shapes from far away."""

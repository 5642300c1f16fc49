"""The formulas of truth, by area.  No module here imports a renderer."""

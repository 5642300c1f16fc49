"""The gate for other people's renderers: their pictures against a scene or another picture."""

"""Rendering a scene, and queries of it with arrays."""

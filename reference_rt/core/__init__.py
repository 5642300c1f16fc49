"""Vectors, rays, transforms, the base of all descriptions, image files."""

"""Spheres, tori, and quadrics with the cylinders and cones that are made of them."""

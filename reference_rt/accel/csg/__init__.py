"""Rays and CSG solids."""

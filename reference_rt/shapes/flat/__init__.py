"""Planes and pieces of planes: disks, rectangles, polygons."""

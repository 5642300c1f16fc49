"""Triangle meshes: from files or arrays, their topology, and the intersection with a triangle."""

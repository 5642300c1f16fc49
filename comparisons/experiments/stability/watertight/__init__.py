"""F3: closed meshes do not leak."""

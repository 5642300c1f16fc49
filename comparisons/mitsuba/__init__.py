"""Mitsuba: how it is loaded, its scene files, and its hits and pictures.

- `backend`, `llvm_libraries`: which variant of Mitsuba runs, with which LLVM.
- `plugins`: materials and an integrator that Mitsuba lacks.
- `parse`, `included`, `node`: what its own parser reads of its scene files; `files`: written ones.
- `plugin_table`: plugins as tables that are read both ways; `colours`: spectra and indices of
  refraction as it has them; `context`: what a translation knows of its scene.
- `counterpart`: the loaded scene (`Counterpart`) and `trace`, its first hits; `csg`: those of
  solids.
- `hits`: how each Mitsuba shape represents ours, and its hits in our numbering; `scene`: rays and
  pictures as NumPy arrays.
- `second`: the files of our scenes, read by other libraries.

Arrays are float64, lengths in scene units, angles of normals in radians; Mitsuba rounds to float32.
-1 is a miss or no instance, an error of 0 means exact.  Everything that needs Mitsuba raises
ReferenceUnavailableError without it.
"""

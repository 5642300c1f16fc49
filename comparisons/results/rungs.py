"""The names of the rungs, in their order; imported without NumPy, for the options of commands."""

RUNGS = (
    *("scene", "run", "input", "files", "film", "solids", "geometry"),
    *("direct", "sampling", "transport", "whitted", "layers"),
    *("statistics", "images", "witness"),
    *("derivative", "adjoint"),
)
"""The ladder, in order: a failure is reported at the first rung that breaks.  `scene` exists only
if the scene or one of its files is invalid, `run` only if the case could not be completed; `input`
checks the pictures themselves, `files` what we hold of files and descriptions; `solids` asks a
third tracer, `witness` is there only if a third renderer is asked; the
last two are of a derivative, which is asked for in place of a picture."""

COMPARED = RUNGS[3:-2]
"""The rungs that compare the two renderers: those a suite can be limited to."""

OF_LIGHT = ("direct", "whitted", "statistics", "images")
"""Those whose difference may show Mitsuba's precision in place of a fault."""

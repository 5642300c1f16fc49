"""The command line `reference-rt`: render, explain, schema.

`main` has the commands and their exit codes; `explain` and `limits` compute what `explain` prints.
Contract: results go to files or standard output; progress and errors to standard error.  Every
error is one line and an exit code, without a traceback (`guarded.guarded`).  To add a command: a
function in `main` with `@app.command()` and `@guarded`; another package registers its own through
the entry point `reference_rt.commands`.
"""

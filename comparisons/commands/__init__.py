"""The commands that `comparisons` adds to `reference-rt`, those of one subject in a file.

A command is a Typer function of its name, decorated with `guarded`, which turns errors
into messages and exit codes.  The function parses options and writes to the terminal; the work is
done by the package that it imports when it runs, inside `compare_extra`: `reference-rt render` must
not wait for those imports.  Arguments and outputs are checked before the work begins.

To add a command, write its function and list it in `register.py`; options that several commands
have are in `options.py`, and what they write is an `Outputs`.
"""

"""Utilities that know nothing of rendering, one module each; they import only each other.

- `errors.py`: exceptions that a user can cause, with exit codes; `printable` for names in messages
- `files.py`: reading regular files within limits, and writing files atomically
- `yaml_text.py`: YAML 1.2 as plain data, and the line of an error
- `memory.py`: the machine's memory, in bytes; refuses what cannot fit
- `processes.py`: SIGINT, SIGTERM and SIGHUP as exceptions; children that end with their parent
- `extras.py`: packages that only some commands need, and what to install
- `console.py`: progress bars, on standard error

A message of an error is one line: what was found, then "; expected ..." what would be right.
"""

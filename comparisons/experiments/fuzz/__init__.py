"""Differential fuzzing: random scenes through both renderers, and cases reduced to a few lines.

- `schema.py`: the types of the scene schema; `fields.py`, `meshes.py`, `assets.py`: random values
  of fields, meshes, and files;
- `parts.py`, `generate.py`: random parts, and the scene that is made of them, as `data.py`;
- `check.py`: one scene through the rungs, `identities.py` through changes that must not matter;
- `finding.py`: what is asked for, with how much effort, and what is found; `results.py`: kept in a
  folder, so that a run is resumed;
- `reduce.py`: a failing scene made small while it fails in the same way;
- `worker.py`, `run.py`: processes that may crash;
- `summary.py`, `coverage.py`: what was found and covered, for people and programs;
- `planted.py`: how soon faults that are planted in the source are found.

A scene is a function of the run's seed and its number, so a number repeats it.  It is generated as
data of the scene schema, of a random subset of all types (swarm testing, Groce et al. 2012),
written as YAML and read again.

A finding is what no right renderer shows: a rung says `differ` or `invalid`, an identity is broken,
a number is not finite, or the process stops with an error, dies or hangs.  Statistics have false
alarms, about one in a thousand scenes: a difference of theirs counts if other random numbers, and
four times as many, show it again.

To add a type: nothing, if its schema and its validators say what is allowed.  Where random numbers
of the schema's range would be rare in practice or are mostly refused, a line in `fields.RANGES` or
a function in `fields.SPECIAL`.
"""

"""What families are made of, and what runs them.

- `core`: the vocabulary (Draw, Outcome, Shot; Family, Series, Sweep, and the list of families),
  outcomes (which cases failed, examples word for word), and sweep points added up.
- Outcomes: `worlds` (scenes of one known radiance; two-stage tests of means, false alarms below
  1e-8).
- Cases that several families draw: `bsdfs`, `meshes`, `scenes`, `solids`, `steps`.
- The run: `run` has each point of each sweep measured by a worker process, itself as a module, and
  kept by `comparisons.runs.engine`, and makes the images of failures; `outputs` shows it.

A point depends on (seed, family, series, x) alone (`generator`), so that any can be measured again
by itself, in any order.
"""

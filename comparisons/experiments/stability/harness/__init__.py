"""What families are made of, and what runs them.

- Vocabulary: `family` (Family, Series, Sweep, and the list), `core` (Draw, Outcome, Shot).
- Outcomes: `core` (which cases failed, examples word for word), `bits` (pictures), `chance`
  (two-stage tests of means, false alarms below 1e-8), `worlds` (scenes of one known radiance).
- Cases that several families draw: `bsdfs`, `densities`, `leaving`, `meshes`, `scenes`,
  `solids`, `steps`.
- The run: `run` sends each point of each sweep to a worker process (`worker`), keeps the result in
  a file (`core`) and makes the images of failures; `table` adds up; `table`, `page`,
  `results_json` and `display` show it.

A point depends on (seed, family, series, x) alone (`generator`), so that any can be measured again
by itself, in any order.
"""

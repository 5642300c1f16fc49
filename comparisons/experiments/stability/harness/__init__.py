"""What families are made of, and what runs them.

- Vocabulary: `family` (Family, Series, Sweep, Draw, Outcome, Shot), `families` (the list).
- Outcomes: `outcomes` (which cases failed, examples word for word), `bits` (pictures), `chance`
  (two-stage tests of means, false alarms below 1e-8), `worlds` (scenes of one known radiance).
- Cases that several families draw: `bsdfs`, `densities`, `leaving`, `meshes`, `rays`, `rooms`,
  `scenes`, `solids`, `steps`.
- The run: `run` sends each point of each sweep to a worker process (`worker`), keeps the result in
  a file (`result`) and makes the images of failures; `summary` adds up; `table`, `charts`, `page`,
  `results_json` and `display` show it.

A point depends on (seed, family, series, x) alone (`generator`), so that any can be measured again
by itself, in any order.
"""

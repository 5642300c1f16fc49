"""What families are made of, and what runs them.

- `series`: Draw, Sweep, Series, Family, how a series is registered, and the list of families;
  `outcomes`: which cases failed, examples word for word; `shots`: pictures of failures.
- `worlds`: scenes of one known radiance; `chance`: two-stage tests of means, false alarms below
  1e-8.
- What several families draw or ask: `bsdfs`, `half_vectors`, `meshes`, `scenes`, `solids`, `steps`
  of transforms, `rays` at rows of tables, `shadows`, scenes `in_mitsuba` as they are; formulae
  `exactly`.
- The run: `run` has each point of each sweep measured by a worker process, itself as a module, and
  kept by `comparisons.runs.engine`, and makes the images of failures; `points` are stored and
  added up; `outputs` and `page` show them.

A point depends on (seed, family, series, x) alone (`generator`), so that any can be measured again
by itself, in any order.
"""

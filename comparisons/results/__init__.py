"""The result of a comparison as data, its verdict, and how it is stored.

- `case`: `Case`, the result for one scene: a verdict, one `RungResult` for each rung, the pictures,
  image metrics, the likeliest cause; `decide`, from rungs to the verdict of a case; `exit_code`,
  from verdicts to that of a run.  Radiance is in W/sr/m², times in seconds, places in pixels.
- `stored_case`: one case, `case.json` and `pictures.exr`, read back exactly or refused.
- `naming`: what sentences call the sides of a case.
- `files`: files with checksums for anything else that a later run continues from; values in JSON's
  types; JSON and CSV files, written whole or not at all.

None means that a case does not have the item; NaN that a metric is undefined.  To add a field to
`Case`: give it a default, and raise `stored_case.SCHEMA` if older files would be misread.
"""

LIMIT = 0.005
"""The smallest relative bias of the image mean that must be detectable, unless another is asked
for."""

"""BSDFs, one file each; their register, `tables.py`; `dispatch.py`, which chooses among them.

A file has a description (a `Material`), its table (a NamedTuple of arrays, a row for each material
of this type), and kernels that take the table, a row i, texture coordinates `at`, and directions as
in the contract of `materials`:

- `eval_pdf(table, i, at, wo, wi) -> Scattered`: f(wo, wi) |cos wi| and the density of `sample` per
  solid angle; needed by a material whose class says `smooth`;
- `sample(table, i, at, wo, u_lobe, u0, u1) -> BsdfSample`: pdf = 0 means that sampling failed; its
  weight and pdf agree with `eval_pdf`; needed like `eval_pdf`;
- `branches(table, i, at, wo) -> Branches`: the delta lobes; needed if the class says `delta`;
- `ambient(table, i, at) -> Vec3`: k_a of Whitted's integrator; optional.

Kernels are IEEE arithmetic in the order written and return the same bits as plain Python; nothing
that they return is NaN or infinite for unit directions.  A material that does not say that it
`transmits` is black behind.

To add one: its file, and its lines in `tables.py`.  What several files share is in the simplest of
them, such as `Metal` in `conductor.py`; the lobes of both principled materials are in
`principled_lobes.py`.
"""

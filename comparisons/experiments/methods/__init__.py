"""`reference-rt methods`: error against time of the textbook's intersection methods.

A family (`of_sphere`, `of_triangle`, ...) is a set of methods that answer the same question, with
`exact`, which answers it in exact arithmetic, and parameter sweeps from ordinary to extreme.
`errors` and `timing` measure one setting, `run` all of them; `terminal`, `written` and `page` show
the rows.  Times are nanoseconds per ray and shape, errors multiples of u = 2^-53.

To add a series, write a function (draw, x) -> trials in its family's file and decorate it with
`FAMILY.sweep(name, axis, values, extreme)`; its docstring is the text on the page.  A method that
`reference_rt.textbook` registers is measured automatically.
"""

"""`reference-rt methods`: the text-book's ways to intersect, as error against time.

`of_sphere`, `of_triangle`, ... hold the settings of each family, from ordinary to extreme, and the
truth about them in exact arithmetic; `errors` and `timing` measure `reference_rt.textbook` in
these; `run` does all; `terminal`, `written` and `page` show it.  To add a series, add it to its
family's tuple; a method that `reference_rt.textbook` registers is measured without more.
"""

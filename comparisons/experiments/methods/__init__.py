"""`reference-rt methods`: how long the textbook's intersection methods take.

`trials` draws shapes and rays, `run` times all methods of all series; `outputs`
writes and shows the rows.  Times are nanoseconds per ray and shape.  How wrong the methods are is
measured by `comparisons.experiments.stability`, on extreme shapes and rays.

To add a series, write a function (draw, x) -> trials in `trials` and a line of `SERIES`; its
docstring is the text on the page.  A method that `reference_rt.textbook` registers is timed without
more.
"""

"""`reference-rt converge`: error against run time, of our renderer and Mitsuba's.

A method under test (`methods`) is a renderer with one sampler.  A rung is a number of samples per
pixel; the ladder renders replicates at each rung, the methods taking turns.  `estimates`
and `findings` turn rungs into errors, slopes, bias and times to a target error; `store`
keeps finished rungs; `outputs` and `page` show the `Curves`.

Errors are relMSE, or its square root, the relative error; times are seconds of warm renders on all
cores.  Deterministic scenes have `Grids` instead of a ladder.

To add a method, add it to `methods.METHODS`; if its renderer is another one, `methods.Stable.ready`
must return a function (samples per pixel, replicate) -> `Shot` for it.
"""

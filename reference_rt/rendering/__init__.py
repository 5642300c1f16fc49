"""Rendering a scene to a picture, and array queries of a scene.

`scene.Scene` is the description with its queries as methods.  `render.render` computes a `Picture`
by a `render.Session`, one render: the loop that hands out units of work and stops at limits
(`loop`, `units`), what computes them (`executor`), by which kernels (`kernels`, `linking`; their
code is in `tiles`), and the sums of its samples, in memory and in checkpoints (`accumulation`,
`framebuffer`).  `noise` estimates the error.  `image` displays pictures (`picture`), and writes
them to files.  `warm_up` lists all kernels that can be compiled ahead of time.  `query` has the
array queries (hits, crossings, camera rays, BSDFs, lights, radiance), which take a scene's tables.

Contract: float64 everywhere; a picture's row 0 is its top; radiance in W sr^-1 m^-2, linear sRGB;
the number of threads, processes and machines changes no bit.  To add an AOV: a field of
`integrators.ray_cast.Cast` or a kernel in `tiles`, its sums in `accumulation`, its channel names in
`image`, its name in `Film.layers`.
"""

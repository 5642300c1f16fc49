"""Rendering a scene to a picture, and array queries of a scene.

`scene.Scene` is the description with its queries as methods.  `render.render` computes a `Picture`:
it compiles the kernels of `tiles` and runs them on a thread pool, one tile of pixels per task.
`image` writes pictures to files.  `query` has the array queries (hits, crossings, camera rays,
BSDFs, lights, radiance), which take a scene's tables.

Contract: float64 everywhere; a picture's row 0 is its top; radiance in W sr^-1 m^-2, linear sRGB;
the number of threads changes no bit.  To add an AOV: a field of `integrators.ray_cast.Cast` or a
kernel in `tiles`, its array in `render`, its channel names in `image`, its name in `Film.layers`.
"""

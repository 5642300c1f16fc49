"""Rendering a scene to a picture, and array queries of a scene.

`scene.Scene` is the description with its queries as methods.  `render.render` computes a `Picture`.
A `session.Session` is one render: its scene's tables and kernels (`prepared`), the sums of its
samples (`accumulation`, `framebuffer`), the units that are left of it (`units`), what computes them
(`executor`, `processes`, `cluster`), and the loop that hands them out and stops at limits (`loop`).
`checkpoint` stores the sums, `noise` estimates the error, `streaming` writes what does not fit into
memory.  `image` writes pictures to files.  `query` has the array queries (hits, crossings, camera
rays, BSDFs, lights, radiance), which take a scene's tables.

Contract: float64 everywhere; a picture's row 0 is its top; radiance in W sr^-1 m^-2, linear sRGB;
the number of threads, processes and machines changes no bit.  To add an AOV: a field of
`integrators.ray_cast.Cast` or a kernel in `tiles`, its sums in `accumulation`, its channel names in
`image`, its name in `Film.layers`.
"""

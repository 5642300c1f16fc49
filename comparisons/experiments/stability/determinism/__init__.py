"""F14: a picture depends on its scene and seed alone.

Law.  The same bits for any number of threads; any size and order of the bands of pixels; samples
split at any place; rendering stopped anywhere and carried on by another process from its file; any
number of rays in a block; plain Python instead of compiled kernels.

Range.  1 to 16 threads, bands of 1 pixel to the whole picture in shuffled order, 1 to 8 interrupts,
blocks of 8 to 256 rays.

Counts.  Each pixel is a case, of 48 x 36, in the path-traced scene and the one by Whitted of
`harness.scenes`; in plain Python of 8 x 6.

Passes.  Every bit is the same.

Mitsuba renders the path-traced scene of 96 x 72 pixels three times with the same seed, its scalar
variant with the box filter, and scalar and llvm with the Gaussian, on 1 to 16 threads against 1.
`threads`: any number of threads; `parts`: bands, interrupts, plain Python.
"""

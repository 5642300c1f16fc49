"""Array types for signatures."""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

IdArray = npt.NDArray[np.int32]
"""Indices of shapes, triangles, parts, copies and texels: 32 bits hold every index of a scene in
memory.  With 64 bits first hits of camera rays took a tenth longer, since most of them only write
that they miss (measured)."""

Bounds = tuple[FloatArray, FloatArray]
"""The lowest and the highest corners of axis-aligned boxes: (n, 3) each."""

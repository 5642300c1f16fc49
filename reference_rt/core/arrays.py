"""Array types for signatures."""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

Bounds = tuple[FloatArray, FloatArray]
"""The lowest and the highest corners of axis-aligned boxes: (n, 3) each."""

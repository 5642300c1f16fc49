"""NumPy files, .npy, with arrays of floats."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.core.image_files.image_file import ImageFile, StoredStrip, as_float64
from reference_rt.util.files import open_input


@dataclass(frozen=True)
class NpyFile(ImageFile):
    """array: memory-mapped, (height, width), or with 3 or 4 channels, the fourth being opacity."""

    array: Any = None

    def stored(self, with_opacity: bool = False) -> Iterator[StoredStrip]:
        with open_input(self.path) as file:
            for rows in self.row_ranges():
                found = self.array[rows]
                if self.array.flags.c_contiguous:
                    # Read rather than mapped: rows that are done do not stay in memory.
                    file.seek(self.array.offset + rows.start * self.array.strides[0])
                    found = np.fromfile(file, found.dtype, found.size).reshape(found.shape)
                if found.dtype.itemsize > 8:  # long doubles
                    found = as_float64(found)
                opacity = found[..., 3] if self.has_opacity and with_opacity else None
                values = found[..., None] if self.is_grey else found[..., :3]
                yield StoredStrip(rows, values, opacity)


def open_npy(path: Path) -> ImageFile:
    """Raises ValueError (what is wrong, what was expected)."""
    array = map_npy(path)
    if array.ndim not in (2, 3) or (array.ndim == 3 and array.shape[2] not in (3, 4)):
        raise ValueError(
            f"has the shape {array.shape}; expected (height, width), (height, width, 3), or with "
            "opacity (height, width, 4)"
        )
    height, width = array.shape[:2]
    return NpyFile(
        path,
        width,
        height,
        kind=f"float{min(64, 8 * array.dtype.itemsize)}",
        is_grey=array.ndim == 2,
        bits=8 * array.dtype.itemsize,
        has_opacity=array.ndim == 3 and array.shape[2] == 4,
        array=array,
    )


def map_npy(path: Path) -> npt.NDArray[Any]:
    """The array of floats, of any shape, in a file, memory-mapped.  Raises ValueError (what is
    wrong, what was expected), OSError."""
    open_input(path).close()  # not a pipe, which could not be mapped
    try:
        mapped: npt.NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
    except OSError:
        raise
    except Exception as error:  # its parser is Python's, with any of its exceptions
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"cannot be read as NPY: {reason}; expected an array of floats") from None
    if mapped.dtype.kind != "f":
        raise ValueError(f"holds {mapped.dtype}; expected floats (float16, float32, float64)")
    return mapped

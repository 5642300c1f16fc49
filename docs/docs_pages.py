"""What the scripts of this folder share: where the pages are, and how pictures are stored."""

import io
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image

from reference_rt.util.files import replacing

DOCS = Path(__file__).parent


def save(path: Path, values: npt.NDArray[np.uint8]) -> None:
    """Write (height, width, 3) pixels as a JPEG file."""
    data = io.BytesIO()
    Image.fromarray(values).save(data, "JPEG", quality=88, optimize=True)
    with replacing(path) as temporary:
        temporary.write_bytes(data.getvalue())

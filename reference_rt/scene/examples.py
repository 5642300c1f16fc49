"""Examples of every type of a scene's parts, from the types' own files, and what they name."""

from pathlib import Path
from typing import Any

import numpy as np

from reference_rt.core.model import types_of
from reference_rt.core.transform import Scale
from reference_rt.materials import Diffuse, Mirror
from reference_rt.media import Homogeneous
from reference_rt.shapes import Box, Sphere
from reference_rt.textures import Bitmap

NAMED: dict[str, dict[str, Any]] = {
    "textures": {
        "texture": Bitmap(file="image.npy", encoding="raw"),
        "small": Bitmap(file="image.npy", encoding="raw", scale=0.25),
    },
    "materials": {"base": Diffuse(), "other": Mirror()},
    "media": {"medium": Homogeneous(sigma_t=(0.5, 0.5, 0.5), albedo=(0.5, 0.5, 0.5))},
    "groups": {"group": (Sphere(radius=0.8), Box(transform=(Scale(scale=(0.5, 0.5, 0.5)),)))},
}
"""Fields of a scene with all that examples name but files."""


PHOTOMETRY = """IESNA:LM-63-2002
[TEST] an example
[MANUFAC] none
TILT=NONE
1 -1 2 3 2 1 2 0 0 0
1 1 10
0 45 90
0 90
900 700 50 900 400 0
"""


def write_files(folder: Path) -> None:
    """The files that examples name: an image, which files of float32 hold exactly, the maps of two
    copies, and photometry."""
    image = np.linspace(0.1, 0.9, 12 * 3, dtype=np.float32)
    np.save(folder / "image.npy", image.reshape(3, 4, 3))
    np.save(folder / "copies.npy", np.stack([np.eye(4)[:3], 0.5 * np.eye(4)[:3]]))
    (folder / "lamp.ies").write_text(PHOTOMETRY, encoding="ascii")


def examples(kind: Any) -> list[Any]:
    """All examples of a type, or of the types of a union such as `AnyShape`, in its order."""
    types: Any = [kind] if isinstance(kind, type) else types_of(kind)
    return [of(**fields) for of in types for fields in of.EXAMPLES]

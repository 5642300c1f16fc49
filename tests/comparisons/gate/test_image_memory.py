"""How much memory a process takes to read a texture or an environment map."""

import os
import subprocess
import sys

import numpy as np
import pytest
from picture_writers import exr, hdr, npy, pfm, png, rgbe
from PIL import Image

SIZE = (1600, 2500)

CHILD = """
import sys
from pathlib import Path
import numpy as np
import reference_rt as rt
from reference_rt.scene.build_textures import texture_tables
from reference_rt.lights.emitters.environment_map import tabulate
import reference_rt.core.image_files, OpenEXR
from PIL import Image

def peak():
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM"))

Image.init()
# What is imported and compiled at the first use is not what is measured.
rt.Scene(), rt.Bitmap(file="a.png"), rt.EnvironmentMap(file="a.exr")
tabulate(np.ones((4, 8, 3)), np.eye(3))
before = peak()
if sys.argv[1] == "bitmap":
    files = sys.argv[2:]
    scene = rt.Scene(textures={f"t{k}": rt.Bitmap(file=f) for k, f in enumerate(files)})
    tables = texture_tables(scene)
else:
    tables = rt.EnvironmentMap(file=sys.argv[2]).tabulate(Path())
print(peak() - before)
"""

LARGE = {
    "a.png": lambda path: Image.fromarray(large_codes()).save(path, compress_level=1),
    "deep.png": lambda path: png(path, large_codes().astype(np.int64) * 257, 16),
    "a.jpg": lambda path: Image.fromarray(large_codes()).save(path),
    "a.exr": lambda path: exr(path, large_floats()),
    "a.pfm": lambda path: path.write_bytes(pfm(large_floats(), "-1")),
    "a.npy": lambda path: path.write_bytes(npy(large_floats().astype(np.float64))),
    "a.hdr": lambda path: path.write_bytes(hdr(rgbe(large_floats()), runs=False)),
}


QUICK = ("deep.png", "a.exr")
"""Those that come nearest to the bound, or would be beyond it if they were read as a whole."""


def large_codes():
    values = np.arange(SIZE[0] * SIZE[1] * 3) % 251
    return values.reshape(*SIZE, 3).astype(np.uint8)


def large_floats():
    return large_codes().astype(np.float32) + 0.5


def peak_of(place, *files):
    """Bytes a pixel that a process took at most."""
    done = subprocess.run(
        [sys.executable, "-c", CHILD, place, *map(str, files)],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
    )
    return int(done.stdout) / (SIZE[0] * SIZE[1] * len(files))


TEXEL = {"a.png": 3, "deep.png": 6, "a.jpg": 3, "a.exr": 12, "a.pfm": 12, "a.npy": 24, "a.hdr": 12}
"""Bytes of a texel: as many as the file's own values have."""

MEMORY = [
    ("bitmap", 2, "a.png", 3 + 8),
    ("environment", 1, "a.png", 38),
    *(
        pytest.param("bitmap", 1, n, TEXEL[n] + 8, marks=() if n in QUICK else pytest.mark.slow)
        for n in LARGE
    ),
]
"""Bytes a pixel at most: eight to read a texture.  An environment map stores 36, 8 of them for its
sums and 4 for their guides: two more for what is freed between them but not given back."""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux for the most memory so far")
@pytest.mark.parametrize(("place", "number", "name", "most"), MEMORY)
def test_memory_of_textures_and_of_an_environment(tmp_path, place, number, name, most):
    LARGE[name](tmp_path / name)
    assert peak_of(place, *[tmp_path / name] * number) <= most

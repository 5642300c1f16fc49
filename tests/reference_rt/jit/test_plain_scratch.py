"""Kernels as plain Python: scratch that nothing was stored in."""

import os
import subprocess
import sys

RENDER = """
import numpy as np

empty = np.empty


def poisoned(*arguments, **named):
    found = empty(*arguments, **named)
    if found.dtype.kind == "f":
        found.fill(np.nan)
    return found


np.empty = poisoned
import reference_rt as rt

scene = rt.Scene(
    film=rt.Film(width=4, height=4),
    materials={"red": rt.Diffuse(reflectance=(0.7, 0.2, 0.1))},
    shapes=(rt.Sphere(center=(0, 0, -3), material="red"),),
    lights=(rt.Constant(radiance=1),),
)
assert np.isfinite(rt.render(scene, spp=1, threads=1).colour).all()
"""


def test_fresh_memory_that_is_not_a_number_is_not_used():
    """Materials without textures store no place, and it is read with the others."""
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    subprocess.run([sys.executable, "-c", RENDER], check=True, env=environment)

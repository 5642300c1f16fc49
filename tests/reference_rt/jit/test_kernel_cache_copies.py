"""Copies of the package share their kernels: an installed one and the sources beside it, or one in
the cache of a build server that is restored in another folder."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest

import reference_rt

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")

_RAYS_AND_PICTURE = """
import reference_rt as rt
from reference_rt.jit import links
from reference_rt.rendering.query.rays import camera_kernel
from reference_rt.rendering.tiles import aov_tile
scene = rt.Scene(
    shapes=(rt.Sphere(),), integrator=rt.RayCast(), film=rt.Film(width=2, height=2)
)
scene.camera_rays()
rt.render(scene, threads=1)
kernels = [camera_kernel, aov_tile]
for group in (rt.accel.geometry.geometries,):
    for operation in group.operations.values():
        kernels += operation._entries.values()
hits = sum(sum(kernel.stats.cache_hits.values()) for kernel in kernels)
misses = sum(sum(kernel.stats.cache_misses.values()) for kernel in kernels)
print(rt.__file__, hits, misses)
"""


@pytest.mark.slow
def test_a_copy_finds_the_kernels_of_another(tmp_path):
    package, found = Path(reference_rt.__file__).parent, []
    for name in ("one", "other"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(package, tmp_path / name / "reference_rt", ignore=ignored)
        done = subprocess.run(
            [sys.executable, "-c", _RAYS_AND_PICTURE],
            env=os.environ
            | {"PYTHONPATH": str(tmp_path / name), "REFERENCE_RT_CACHE": str(tmp_path / "cache")},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        )
        file, hits, misses = done.stdout.split()
        assert Path(file).is_relative_to(tmp_path / name)
        found.append((int(hits), int(misses)))
    (none, compiled), (loaded, missed) = found
    assert none == 0
    assert compiled >= 4
    assert (loaded, missed) == (compiled, 0)

"""Kernels: folders of their cache, memory that they reserve, and reciprocals."""

import os
import subprocess
import sys

import numpy as np
import pytest

from reference_rt.jit.kernel import entry_kernel, local_floats, local_integers, reciprocal


@pytest.mark.slow
def test_bounds_checking_has_its_own_folder(tmp_path):
    _HIT_FOLDER = "from reference_rt.jit.kernel import CACHE_FOLDER; print(CACHE_FOLDER)"
    folders = {
        subprocess.run(
            [sys.executable, "-c", _HIT_FOLDER],
            env=os.environ | {"REFERENCE_RT_CACHE": str(tmp_path), "NUMBA_BOUNDSCHECK": flag},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for flag in ("0", "1")
    }
    assert len(folders) == 2


@entry_kernel
def _scratch(n, out):
    floats, integers = local_floats(n), local_integers(n)
    for i in range(n):
        floats[i], integers[i] = 0.5 * i, -i
    for i in range(n):
        out[i] = floats[i] + integers[i]


def test_scratch():
    out = np.zeros(100)
    _scratch(100, out)
    assert np.array_equal(out, -0.5 * np.arange(100))


def test_reciprocal():
    assert reciprocal(4.0) == 0.25
    assert (reciprocal(0.0), reciprocal(-0.0)) == (np.inf, -np.inf)

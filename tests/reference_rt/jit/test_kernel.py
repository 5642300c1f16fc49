"""The cache of compiled kernels: exact, and not needed."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import reference_rt
from reference_rt.jit.kernel import entry_kernel, local_floats, local_integers, reciprocal

_HIT = """
from reference_rt import Scene, Sphere, build_tables, query
from reference_rt.jit import kernel
found = query.intersect(build_tables(Scene(shapes=(Sphere(),))), [[0, 0, 3.0]], [[0, 0, -1.0]])
from reference_rt.rendering.query.tracing import closest_of_few
print(kernel.CACHE_FOLDER, found.t[0], sum(closest_of_few.stats.cache_hits.values()))
"""


def first_hit(package_parent, cache, **environment):
    """(cache folder, t of the first hit, kernels that came from the cache) in a new process."""
    done = subprocess.run(
        [sys.executable, "-c", _HIT],
        env=os.environ
        | {"PYTHONPATH": str(package_parent), "REFERENCE_RT_CACHE": str(cache)}
        | environment,
        cwd=package_parent,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    folder, t, hits = done.stdout.rsplit(maxsplit=2)
    return folder, float(t), int(hits)


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """A copy of the package whose sources may be changed."""
    parent = tmp_path_factory.mktemp("copy")
    shutil.copytree(Path(reference_rt.__file__).parent, parent / "reference_rt")
    return parent


@pytest.mark.slow
def test_an_edit_of_a_callee_is_seen(copy, tmp_path):
    """Numba's own cache would return the old result: the entry's file did not change."""
    cold = first_hit(copy, tmp_path)
    warm = first_hit(copy, tmp_path)
    assert cold == (warm[0], 2.0, 0)
    assert warm[1:] == (2.0, 1)
    callee = copy / "reference_rt" / "shapes" / "curved" / "sphere.py"
    text = callee.read_text()
    found = "return Crossing(t, 0.0, 0.0)"
    assert text.count(found) == 1
    callee.write_text(text.replace(found, found.replace("t,", "t + 0.5,")))
    edited = first_hit(copy, tmp_path)
    callee.write_text(text)
    assert edited[1:] == (2.5, 0)
    assert edited[0] != warm[0]
    assert first_hit(copy, tmp_path) == warm


@pytest.mark.slow
def test_bounds_checking_has_its_own_folder(copy, tmp_path):
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


@pytest.mark.slow
def test_no_cache_can_be_written(copy, tmp_path):
    (tmp_path / "file").write_text("")
    assert first_hit(copy, tmp_path / "file" / "cache") == ("None", 2.0, 0)


@pytest.mark.slow
def test_damaged_files_are_compiled_again(copy, tmp_path):
    """Without a word; the process after the next finds them whole."""
    cold = first_hit(copy, tmp_path)
    files = [path for path in Path(cold[0]).iterdir() if path.is_file()]
    assert files
    for path in files:
        data = bytearray(path.read_bytes())
        data[len(data) // 2] ^= 1  # within the machine code
        path.write_bytes(data)
    assert [first_hit(copy, tmp_path) for _ in range(2)] == [cold, (cold[0], 2.0, 1)]


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

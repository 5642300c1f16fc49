"""NUMBA_DISABLE_JIT=1 runs the same text as plain Python, to the same last bit."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from builders import SCENES, everything

import reference_rt as rt

VARIANTS = {
    "path": {},
    "whitted": {"integrator": rt.Whitted(), "sampler": rt.Grid(spp=1)},
    "ray_cast": {"integrator": rt.RayCast(), "sampler": None},
    "independent, tent": {
        "sampler": rt.Independent(spp=2, seed=5),
        "film": rt.Film(width=6, height=4, filter=rt.TentFilter()),
    },
}
SMALL = rt.Film(width=6, height=4)

_RENDER = """
import sys, numpy as np
sys.path.insert(0, sys.argv[1])
import test_plain_python as here
from pathlib import Path
np.savez(sys.argv[3], **here.pictures(Path(sys.argv[2])))
"""


def pictures(folder):
    """Every variant of the scene with everything, and two without a hierarchy."""
    scene = rt.Scene.load(everything(folder))
    scenes = {name: scene.changed(**parts) for name, parts in VARIANTS.items()}
    box = rt.Scene.load(SCENES / "cornell_box.yaml")
    scenes["cornell_box"] = box.changed(film=SMALL, sampler=rt.Sobol(spp=2))
    spheres = rt.Scene.load(SCENES / "spheres_whitted.yaml")
    scenes["spheres"] = spheres.changed(film=SMALL, sampler=rt.Grid(spp=1))
    return {
        f"{name}.{layer}": pixels
        for name, scene in scenes.items()
        for layer, pixels in rt.render(scene, threads=1).layers.items()
    }


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plain")
    file = folder / "plain.npz"
    arguments = [str(Path(__file__).parent), str(folder), str(file)]
    subprocess.run(
        [sys.executable, "-W", "error", "-c", _RENDER, *arguments],
        check=True,
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
    )
    return pictures(folder), dict(np.load(file))


def test_same_bits(both):
    compiled, plain = both
    assert set(compiled) == set(plain)
    different = [name for name in compiled if not np.array_equal(compiled[name], plain[name])]
    assert different == []


def test_the_pictures_show_something(both):
    for name, pixels in both[0].items():
        assert len(np.unique(pixels)) > 3, name

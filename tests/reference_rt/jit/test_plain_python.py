"""NUMBA_DISABLE_JIT=1 runs the same functions as plain Python, with the same bits."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from builders import HELPERS, SCENES
from galleries import GALLERIES

import reference_rt as rt

SMALL = rt.Film(width=6, height=4)

_RENDER = """
import sys, numpy as np
sys.path.insert(0, sys.argv[1])
import test_plain_python as here
from pathlib import Path
np.savez(sys.argv[3], **here.pictures(Path(sys.argv[2]), sys.argv[4] == "True"))
"""


def scenes(folder, more):
    """Every shape, material, texture, light, integrator and sampler, and two of the usual scenes,
    which lack most of them; `more`: also shapes by paths, and materials and lights by Whitted."""
    layers = ((), ("albedo", "normal", "position"), ("depth", "id", "variance"))
    shapes, materials, lights = (
        gallery(folder).changed(film=SMALL.model_copy(update={"layers": some}))
        for gallery, some in zip(GALLERIES, layers, strict=True)
    )
    whitted = {"integrator": rt.Whitted(), "sampler": rt.Grid(spp=4)}
    box = rt.Scene.load(SCENES / "cornell_box.yaml")
    spheres = rt.Scene.load(SCENES / "spheres_whitted.yaml")
    others = {
        "shapes": shapes,
        "materials, whitted": materials.changed(**whitted),
        "lights, whitted": lights.changed(**whitted),
    }
    return (others if more else {}) | {
        "shapes, ray cast": shapes.changed(integrator=rt.RayCast(), sampler=None),
        "materials": materials,
        "lights": lights,
        "lights, direct": lights.changed(integrator=rt.Direct(light_samples=2, bsdf_samples=2)),
        "cornell box": box.changed(film=SMALL, sampler=rt.Sobol(spp=2)),
        "spheres": spheres.changed(film=SMALL, sampler=rt.Grid(spp=1)),
    }


def pictures(folder, more):
    """Every layer of every scene."""
    return {
        f"{name}: {layer}": pixels
        for name, scene in scenes(folder, more).items()
        for layer, pixels in rt.render(scene, threads=1).layers.items()
    }


@pytest.fixture(scope="module", params=[False, pytest.param(True, marks=pytest.mark.slow)])
def both(tmp_path_factory, request):
    folder = tmp_path_factory.mktemp("plain")
    file = folder / "plain.npz"
    arguments = [str(Path(__file__).parent), str(folder), str(file), str(request.param)]
    plain = subprocess.Popen(  # the while, this process compiles
        [sys.executable, "-W", "error", "-c", _RENDER, *arguments],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(HELPERS)},
    )
    try:
        compiled = pictures(tmp_path_factory.mktemp("compiled"), request.param)
    finally:
        code = plain.wait()
    assert code == 0
    return compiled, dict(np.load(file))


@pytest.mark.slow
def test_same_bits(both):
    compiled, plain = both
    assert set(compiled) == set(plain)
    different = [name for name in compiled if not np.array_equal(compiled[name], plain[name])]
    assert different == []

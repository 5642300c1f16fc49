"""The path loop of blocks gives the bits of the loop that says what a path is."""

import pickle
from unittest import mock

import numpy as np
import pytest
from builders import SCENES, in_plain_python
from galleries import GALLERIES

import reference_rt as rt
from reference_rt.core.ray import put_vector, ray_of
from reference_rt.integrators.simple_path import radiance
from reference_rt.rendering import tiles
from reference_rt.rendering.accumulation import jobs_of
from reference_rt.rendering.kernels import kernels_for, plain_arguments
from reference_rt.sampling import sampler_of

WIDTH, HEIGHT, SPP = 4, 3, 3
FEW = ["cornell_box", "environment", "caustic_glass", "csg_lamp", "camera_thin_lens", "many_lights"]


def small(scene):
    return scene.changed(
        film=scene.film.model_copy(update={"width": WIDTH, "height": HEIGHT}),
        integrator=scene.integrator.model_copy(update={"rr_depth": 2}),
        sampler=scene.resolved_sampler.model_copy(update={"spp": SPP}),
    )


def one_by_one(path, scene, samplers, n, scratch):
    for j in range(n):
        light = radiance(path, scene, ray_of(scratch.rays, j), sampler_of(samplers, j))
        put_vector(scratch.totals, 0, j, light)


def write_sums(given, out):
    """Of each scene whose tile is in a file, the sums of the samples of each pixel."""
    sums = {}
    with np.errstate(all="ignore"):
        for name, arguments in pickle.loads(given.read_bytes()).items():
            for way, function in (("blocks", tiles.radiances), ("simple", one_by_one)):
                sums[f"{name} {way}"] = found = np.zeros((WIDTH * HEIGHT, 3))
                with mock.patch.object(tiles, "radiances", function):
                    tiles.render_tile(*arguments, found, np.zeros((0, 3)), 0, len(found), 0, SPP)
    np.savez(out, **sums)


def in_python(scenes, folder):
    """These sums, by plain Python."""
    given = {name: plain_arguments(jobs_of(one)[0], *setup_of(one)) for name, one in scenes.items()}
    (folder / "given").write_bytes(pickle.dumps(given))
    in_plain_python(__file__, "write_sums", folder / "given", folder / "sums.npz")
    return np.load(folder / "sums.npz")


def setup_of(scene):
    return scene.tables, scene.camera.setup(WIDTH, HEIGHT), scene.film.filter.setup()


def different(sums, names):
    return [n for n in names if sums[f"{n} blocks"].tobytes() != sums[f"{n} simple"].tobytes()]


def test_paths_of_a_block_are_simple_paths(tmp_path):
    """Those of compiled kernels, too."""
    scenes = {name: small(rt.Scene.load(SCENES / f"{name}.yaml")) for name in FEW}
    sums = in_python(scenes, tmp_path)
    assert different(sums, scenes) == []
    for name, scene in scenes.items():
        compiled = np.zeros((WIDTH * HEIGHT, 3))
        (kernel, *_) = kernels_for(jobs_of(scene), *setup_of(scene), 1)
        kernel({"colour": compiled, "m2": np.zeros((len(compiled), 3))}, 0, len(compiled), 0, SPP)
        assert compiled.tobytes() == sums[f"{name} simple"].tobytes(), name
        assert compiled.any()


@pytest.mark.slow
def test_of_every_scene(tmp_path):
    """Of scenes/, and of one with every shape, every material and every light."""
    scenes = {gallery.__name__: gallery(tmp_path) for gallery in GALLERIES} | {
        str(file.relative_to(SCENES)): rt.Scene.load(file) for file in SCENES.rglob("*.yaml")
    }
    paths = {
        name: small(scene)
        for name, scene in scenes.items()
        if isinstance(scene.integrator, rt.Path)
        and scene.integrator.sampling == "both"
        and not scene.has_media  # a simple path follows no media
    }
    assert len(paths) > 100
    assert different(in_python(paths, tmp_path), paths) == []

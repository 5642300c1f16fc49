"""The path loop of blocks gives the bits of the loop that says what a path is."""

import pickle
from unittest import mock

import numpy as np
import pytest
from builders import SCENES, every_law, every_light, every_shape, in_plain_python

import reference_rt as rt
from reference_rt.core.ray import put_vector, ray_of
from reference_rt.integrators.simple_path import radiance
from reference_rt.rendering import tiles
from reference_rt.rendering.accumulation import jobs_of
from reference_rt.rendering.kernels import Running
from reference_rt.sampling import sampler_of

WIDTH, HEIGHT, SPP = 4, 3, 3
FEW = ["cornell_box", "environment", "caustic_glass", "csg_lamp", "camera_thin_lens", "many_lights"]


def small(scene):
    return scene.changed(
        film=scene.film.model_copy(update={"width": WIDTH, "height": HEIGHT}),
        integrator=scene.integrator.model_copy(update={"rr_depth": 2}),
        sampler=scene.resolved_sampler.model_copy(update={"spp": SPP}),
    )


def by_blocks(scene, arguments):
    """The sums of the samples of each pixel, as a picture is rendered."""
    sums = np.zeros((WIDTH * HEIGHT, 3))
    with Running(jobs_of(scene), *arguments, 1) as running:
        running.run(0)({"colour": sums}, 0, len(sums), 0, SPP)
    return sums


def one_by_one(path, scene, samplers, n, scratch):
    for j in range(n):
        light = radiance(path, scene, ray_of(scratch.rays, j), sampler_of(samplers, j))
        put_vector(scratch.totals, 0, j, light)


def write_simple(given, out):
    """Of each scene whose tile is in a file, the sums by `simple_path`."""
    sums = {}
    with mock.patch.object(tiles, "radiances", one_by_one), np.errstate(all="ignore"):
        for name, arguments in pickle.loads(given.read_bytes()).items():
            sums[name] = np.zeros((WIDTH * HEIGHT, 3))
            tiles.render_tile(*arguments, sums[name], None, 0, WIDTH * HEIGHT, 0, SPP)
    np.savez(out, **sums)


def assert_same(scenes, folder):
    """Compiled kernels of blocks, and the plain loop in plain Python."""
    blocks, given = {}, {}
    for name, scene in scenes.items():
        scene = small(scene)
        film = scene.film
        arguments = scene.tables, scene.camera.setup(WIDTH, HEIGHT), film.filter.setup()
        blocks[name] = by_blocks(scene, arguments)
        given[name] = jobs_of(scene)[0].arguments(*arguments)
    (folder / "given").write_bytes(pickle.dumps(given))
    in_plain_python(__file__, "write_simple", folder / "given", folder / "simple.npz")
    simple = np.load(folder / "simple.npz")
    different = [name for name in blocks if blocks[name].tobytes() != simple[name].tobytes()]
    assert different == []
    return blocks


def test_paths_of_a_block_are_simple_paths(tmp_path):
    found = assert_same({name: rt.Scene.load(SCENES / f"{name}.yaml") for name in FEW}, tmp_path)
    assert all(np.any(sums > 0.0) for sums in found.values())


@pytest.mark.slow
def test_of_every_scene(tmp_path):
    """Of scenes/, and of one with every shape, every material and every light."""
    made = {one.__name__: one(tmp_path) for one in (every_shape, every_law, every_light)}
    files = {str(file.relative_to(SCENES)): file for file in sorted(SCENES.rglob("*.yaml"))}
    scenes = {name: rt.Scene.load(file) for name, file in (files | made).items()}
    paths = {
        name: scene
        for name, scene in scenes.items()
        if isinstance(scene.integrator, rt.Path) and scene.integrator.sampling == "both"
    }
    assert len(paths) > 100
    assert_same(paths, tmp_path)

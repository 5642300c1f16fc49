"""Identities: a right renderer keeps them, and each is broken by a renderer that breaks its law."""

import dataclasses
import sys

import numpy as np
import pytest
import yaml

from comparisons.experiments.fuzz import assets, identities
from comparisons.experiments.fuzz.finding import Finding
from comparisons.experiments.fuzz.generate import parse
from comparisons.experiments.fuzz.identities import IDENTITIES, Original
from reference_rt.rendering import query
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene

SCENE = {
    "camera": {"type": "perspective", "eye": [1.0, 2.0, 6.0], "target": [0.0, 0.0, 0.0]},
    "film": {"width": 12, "height": 9},
    "sampler": {"type": "sobol", "spp": 2},
    "materials": {
        "grey": {"type": "diffuse", "reflectance": "tiles"},
        "leaf": {"type": "mask", "base": "grey"},
        "lamp": {"type": "emissive", "radiance": 3.0, "base": "grey"},
    },
    "textures": {"tiles": {"type": "bitmap", "file": "square.png"}},
    "groups": {"pair": [{"type": "box"}, {"type": "sphere", "material": "leaf"}]},
    "shapes": [
        {"type": "sphere", "material": "grey", "transform": [{"scale": [1.0, 0.5, 0.7]}]},
        {"type": "mesh", "file": "ball.obj", "transform": [{"translate": [1.5, 0.2, 0.1]}]},
        {
            "type": "mesh",
            "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.2]],
            "faces": [[0, 1, 2], [1, 3, 2]],
            "material": "lamp",
            "transform": [{"scale": 2.0}, {"translate": [-2.0, 0.5, -1.0]}],
        },
        {"type": "torus", "transform": [{"rotate": {"axis": [1, 2, 3], "degrees": 40}}]},
        {"type": "instance", "group": "pair", "transform": [{"translate": [-1.5, -0.5, 0.3]}]},
        {"type": "plane", "transform": [{"translate": [0.0, 0.0, -4.0]}]},
    ],
    "lights": [
        {"type": "point", "position": [1.0, 4.0, 3.0], "intensity": 20.0},
        {"type": "constant", "radiance": 0.3},
    ],
}

OF_PICTURES = ("renamed", "threads", "hierarchy")
OF_RAYS = ("hierarchy", "reordered", "split", "scaled", "moved", "grouped")


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return parse(SCENE, "scene", assets.write(tmp_path_factory.mktemp("files")))


def result(name, scene, rays=240):
    return IDENTITIES[name](Original(scene, np.random.default_rng(4), rays))


@pytest.mark.parametrize("name", IDENTITIES)
def test_the_renderer_keeps(scene, name):
    assert result(name, scene) == "agree"


def test_all_are_planted_below():
    assert set(IDENTITIES) == {"written", *OF_PICTURES, *OF_RAYS}


@pytest.mark.parametrize("name", OF_PICTURES)
def test_a_picture_that_changes_is_found(scene, name, monkeypatch):
    made = []

    def other(*arguments, **options):
        picture = render(*arguments, **options)
        made.append(picture)
        picture.layers["colour"][3, 4, 1] *= 1.0 + 2.0**-40 * (len(made) > 1)
        return picture

    monkeypatch.setattr(identities, "render", other)
    found = result(name, scene)
    assert isinstance(found, Finding)
    assert found.rung == f"identity {name}"
    assert "1 of 324 numbers differ; the first in row 3, column 4" in found.detail


@pytest.mark.parametrize("name", OF_RAYS)
@pytest.mark.parametrize("fault", ["t", "miss"])
def test_a_ray_that_changes_is_found(scene, name, fault, monkeypatch):
    """In any scene but the one that the identity began with, one hit is wrong."""
    first = []

    def intersect(tables, o, d):
        hits = query.intersect(tables, o, d)
        first.append(tables)
        if tables is first[0] or len(o) < 100:
            return hits
        t, shape = hits.t.copy(), hits.shape.copy()
        k = int(np.flatnonzero(shape >= 0)[7])
        if fault == "t":
            t[k] *= 1.0 + 1e-7
        else:
            t[k], shape[k] = np.inf, -1
        return dataclasses.replace(hits, t=t, shape=shape)

    fake = type(sys)("query")
    fake.__dict__.update(query.__dict__)
    fake.intersect = intersect
    monkeypatch.setattr(identities, "query", fake)
    found = result(name, scene)
    assert isinstance(found, Finding)
    assert found.rung == f"identity {name}"
    assert "rays differ; the first, the ray from" in found.detail
    if fault == "miss" and name != "reordered":
        assert found.cause == "a hit and a miss"


def test_light_that_does_not_scale_is_found(scene, monkeypatch):
    fake = type(sys)("query")
    fake.__dict__.update(query.__dict__)
    calls = []

    def radiance(tables, setup, o, d):
        calls.append(o)
        return query.radiance_without_noise(tables, setup, o, d) * (1.0 + 1e-15 * len(calls))

    fake.radiance_without_noise = radiance
    monkeypatch.setattr(identities, "query", fake)
    found = result("scaled", scene)
    assert isinstance(found, Finding)
    assert found.cause == "light"


def test_a_scene_that_changes_when_written_is_found(scene, monkeypatch):
    monkeypatch.setattr(Scene, "to_yaml", lambda self: self.to_json().replace("20.0", "20.5"))
    found = result("written", scene)
    assert isinstance(found, Finding)
    assert found.cause == "YAML is another scene"


def test_a_normal_that_a_group_turns_wrongly_is_found(scene, monkeypatch):
    """As a normal under a map that is no rotation may be: `t` is right."""
    first = []

    def intersect(tables, o, d):
        hits = query.intersect(tables, o, d)
        first.append(tables)
        if tables is first[0]:
            return hits
        n = hits.n + 1e-3
        return dataclasses.replace(hits, n=n / np.linalg.norm(n, axis=1)[:, None])

    fake = type(sys)("query")
    fake.__dict__.update(query.__dict__)
    fake.intersect = intersect
    monkeypatch.setattr(identities, "query", fake)
    found = result("grouped", scene)
    assert isinstance(found, Finding)
    assert found.cause == "normals differ"


def test_rays_that_start_far_outside_of_the_scene_are_moved_by_their_own_rounding():
    """Rays from hits on an infinite plane start there; of two faces back to back either is hit."""
    data = {
        "camera": {"type": "perspective", "eye": [4, 3, 6], "target": [0, 0, 0]},
        "film": {"width": 16, "height": 12},
        "shapes": [
            {"type": "plane", "transform": [{"rotate": {"axis": [1, 2, 0], "degrees": 80}}]},
            {"type": "box"},
            {"type": "box", "transform": [{"translate": [2, 0, 0]}]},
        ],
    }
    scene = Scene.parse(yaml.safe_dump(data))
    for seed in range(10):
        original = Original(scene, np.random.default_rng(seed), 240)
        for identity in (identities.moved, identities.grouped):
            assert not isinstance(identity(original), Finding)

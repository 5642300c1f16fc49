"""BSDFs, textures and emitters of Mitsuba scenes as we read them: radiance along rays against
Mitsuba's own of the same dictionary."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mitsuba_dicts import both_scenes, deviations, rays_at, theirs_along
from mitsuba_rows import BSDFS, CLAY, EMITTERS, WIDE, bitmap, rgb
from PIL import Image

from comparisons.mitsuba.backend import backend, mitsuba

SAMPLES = 512
"""Of each ray, on each side."""

MOST = 5.5
"""Standard errors.  Of 64 rays in 3 channels and 100 scenes, normal numbers of standard deviation 1
exceed 5.5 with a probability of 7e-4."""

APPROXIMATE = 0.03
"""Mitsuba's tables of rough plastic and its masking of Beckmann microfacets: up to 2.35 % of the
light (README, and the tests of documented deviations)."""


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("images")
    rng = np.random.default_rng(3)
    for name, shape in (("colour", (5, 7, 3)), ("sky", (8, 16, 3)), ("grey", (6, 4))):
        Image.fromarray(rng.integers(20, 255, shape, dtype=np.uint8)).save(folder / f"{name}.png")
    return folder


def shape(kind: str) -> dict[str, Any]:
    t = mitsuba().ScalarTransform4f()
    if kind == "rectangle":
        return {"type": "rectangle", "to_world": t.rotate([1, 0, 0], -60)}
    return {"type": "sphere", "to_world": t.rotate([0, 1, 0], 40).rotate([1, 0, 0], 30)}


def filled(value: Any, folder: Path) -> Any:
    """A dictionary with whole names of files, and with maps in place of functions."""
    if isinstance(value, dict):
        return {key: filled(part, folder) for key, part in value.items()}
    if callable(value):
        return value()
    return str(folder / value) if isinstance(value, str) and value.endswith(".png") else value


def fast() -> None:
    if backend().variant.startswith("scalar"):
        pytest.skip("needs a variant of Mitsuba that takes many rays at once")


@pytest.mark.cases(5)
@pytest.mark.parametrize("kind", ["sphere", "rectangle"])
@pytest.mark.parametrize("name", BSDFS)
def test_light_of_bsdfs_is_that_of_mitsuba(name, kind, images):
    fast()
    bsdf = {} if BSDFS[name] is None else {"bsdf": filled(BSDFS[name], images)}
    scene = {
        "integrator": {"type": "path", "max_depth": 6, "rr_depth": 50},
        "sky": {"type": "constant", "radiance": rgb(0.3, 0.5, 0.4)},
        "sun": {"type": "directional", "direction": [0.3, -1, -0.5], "irradiance": rgb(2, 1.5, 1)},
        "shape": {**shape(kind), **bsdf},
    }
    o, d = rays_at((0.0, 0.0, 0.0), 1.0, 64, seed=1)
    found = deviations(scene, o, d, SAMPLES, APPROXIMATE if name in WIDE else 0.0)
    assert np.abs(found).max() < MOST
    # A shift of the mean of all rays, in standard errors of that mean.
    assert abs(found.mean()) * np.sqrt(found.size / 3) < MOST


@pytest.mark.cases(4)
@pytest.mark.parametrize("name", EMITTERS)
def test_light_of_emitters_is_that_of_mitsuba(name, images):
    fast()
    scene = {
        "integrator": {"type": "path", "max_depth": 3},
        "emitter": filled(EMITTERS[name], images),
        "shape": {**shape("sphere"), "bsdf": {"type": "twosided", "inside": CLAY}},
    }
    o, d = rays_at((0.0, 0.0, 0.0), 1.3, 64, seed=2)  # some miss
    found = deviations(scene, o, d, SAMPLES)
    assert np.abs(found).max() < MOST
    assert both_scenes(scene)[0].radiance(o, d, spp=16).mean.max() > 0.1


LAMPS: dict[str, dict[str, Any]] = {
    "rectangle": {"type": "rectangle"},
    "rectangle_flipped": {"type": "rectangle", "flip_normals": True},
    "disk": {"type": "disk"},
    "disk_flipped": {"type": "disk", "flip_normals": True},
    "sphere": {"type": "sphere"},
    "cube": {"type": "cube"},
    "cylinder": {"type": "cylinder"},
}


@pytest.mark.cases(8)
@pytest.mark.parametrize("base", [None, CLAY], ids=["alone", "on_clay"])
@pytest.mark.parametrize("name", LAMPS)
def test_light_of_lamps_is_that_of_mitsuba(name, base, images):
    fast()
    t = mitsuba().ScalarTransform4f()
    lamp = {
        **LAMPS[name],
        "to_world": t.translate([0.5, 1.5, 0.5]).rotate([1, 0, 0], 75).scale(0.4),
        "emitter": {"type": "area", "radiance": rgb(3, 2, 1)},
    }
    if base is not None:
        lamp["bsdf"] = base
    scene = {
        "integrator": {"type": "path", "max_depth": 4},
        "sky": {"type": "constant", "radiance": 0.1},
        "lamp": lamp,
        "shape": {**shape("sphere"), "bsdf": CLAY},
    }
    ours, lamps = rays_at((0.0, 0.0, 0.0), 1.0, 48, seed=3), rays_at((0.5, 1.5, 0.5), 0.4, 48, 4)
    o, d = (np.concatenate(pair) for pair in zip(ours, lamps, strict=True))
    assert np.abs(deviations(scene, o, d, SAMPLES)).max() < MOST


def test_inside_of_a_shining_dome():
    fast()
    dome = {"type": "sphere", "flip_normals": True, "radius": 5.0, "emitter": {"type": "area"}}
    scene = {
        "integrator": {"type": "path", "max_depth": 3},
        "dome": dome,
        "shape": {**shape("sphere"), "bsdf": CLAY},
    }
    o, d = rays_at((0.0, 0.0, 0.0), 1.3, 64, seed=2)
    o = (o * 0.9).astype(np.float32).astype(np.float64)
    assert np.abs(deviations(scene, o, d, SAMPLES)).max() < MOST


def test_a_wrong_reading_is_seen(images):
    """The comparison's own power: 2 % of the light, and a texture that is upside down."""
    fast()
    o, d = rays_at((0.0, 0.0, 0.0), 1.0, 64, seed=1)
    sky = {"sky": {"type": "constant"}, "integrator": {"type": "path", "max_depth": 2}}

    def light(reflectance: Any) -> tuple[Any, Any]:
        bsdf = {"type": "diffuse", "reflectance": filled(reflectance, images)}
        ours, theirs = both_scenes({**sky, "shape": {**shape("sphere"), "bsdf": bsdf}})
        return ours.radiance(o, d, spp=SAMPLES), theirs_along(theirs, o, d, SAMPLES)

    def far(a: Any, b: Any) -> float:
        error = np.sqrt(a.standard_error**2 + b[1] ** 2 + 1e-12)
        found = (a.mean - b[0]) / error
        return float(max(np.abs(found).max(), abs(found.mean()) * np.sqrt(found.size / 3)))

    upright = bitmap("colour.png")
    upside_down = bitmap("colour.png", to_uv=lambda: mitsuba().ScalarTransform3f().scale([1, -1]))
    assert far(light(upright)[0], light(upright)[1]) < MOST
    assert far(light(upright)[0], light(upside_down)[1]) > 2 * MOST
    assert far(light(0.8)[0], light(0.784)[1]) > MOST

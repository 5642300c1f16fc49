"""The rung of layers: right layers agree, and every fault of a layer is found."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders import SCENES

from comparisons.mitsuba.backend import scalar
from comparisons.rungs import layers
from comparisons.rungs.layers.means import LIMIT, compare_means
from comparisons.rungs.layers.variance import compare_spread
from comparisons.translator import load
from reference_rt.cameras.film import BoxFilter, Film, MitchellFilter
from reference_rt.integrators import RayCast
from reference_rt.rendering import render as rendering
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Sobol
from reference_rt.scene.build import build_tables

ALL = ("albedo", "normal", "position", "depth", "id", "variance")

SCENE = """
camera: {type: perspective, eye: [0.3, 1.4, 5], target: [0, 0.6, 0], fov: 40}
film: {width: 40, height: 32}
sampler: {type: independent, spp: 8}
integrator: {type: path, max_depth: 3}
textures:
  squares: {type: checker, first: [0.8, 0.3, 0.2], second: 0.5, uv: {scale: 6}}
materials:
  floor: {type: diffuse, reflectance: squares}
  clay: {type: diffuse, reflectance: [0.6, 0.4, 0.25]}
  lamp: {type: emissive, radiance: [3, 2.5, 2]}
groups:
  bump:
    - {type: mesh, material: clay, smooth: true, faces: [[0, 1, 3], [1, 2, 3], [2, 0, 3]],
       vertices: [[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.4, 0.4, 0.4]]}
shapes:
  - {type: rectangle, material: floor,
     transform: [{scale: 4}, {rotate: {axis: [1, 0, 0], degrees: -90}}]}
  - {type: sphere, material: clay, center: [-0.9, 0.7, 0], radius: 0.7}
  - {type: instance, group: bump, transform: [{scale: [1, 1.5, 2]}, {translate: [0.3, 0.2, 0.4]}]}
  - {type: sphere, material: lamp, center: [1.2, 1.8, -0.5], radius: 0.4}
lights:
  - {type: constant, radiance: [0.3, 0.35, 0.4]}
"""


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.parse(SCENE)


def film_of(scene: Scene, names: tuple[str, ...], wide: bool = False) -> tuple[Film, Film]:
    film = scene.film.model_copy(
        update={"layers": names, "filter": MitchellFilter() if wide else BoxFilter()}
    )
    return film, film


@pytest.mark.slow
@pytest.mark.parametrize("wide", [False, True])
@pytest.mark.parametrize("sampler", [None, Sobol(spp=8)])
def test_right_layers_agree(
    scene: Scene, tables: Any, counterpart: Any, wide: bool, sampler: Any
) -> None:
    if sampler is not None:
        scene = scene.changed(sampler=sampler)
    found = layers(scene, tables, counterpart, film_of(scene, ALL, wide))
    assert found.status == "agree", found.reason
    assert found.numbers["max_error_over_bound"] < 1.0
    # A tenth of the contrast of the scene would be seen, and so would a tenth of a noise.
    assert found.numbers["albedo_seen"] < 0.05
    assert found.numbers["variance_ratio"] == pytest.approx(1.0, abs=0.1) or sampler is not None


def changed_by(monkeypatch: pytest.MonkeyPatch, name: str, change: Callable[[Any], Any]) -> None:
    """Plants a fault in one layer of all pictures that are rendered."""

    def faulty(scene: Scene, **options: Any) -> Any:
        picture = rendering.render(scene, **options)
        if name in picture.layers:
            picture.layers[name] = change(picture.layers[name])
        return picture

    # `comparisons.rungs.layers` is the function, too.
    monkeypatch.setattr(import_module("comparisons.rungs.layers.rung"), "render", faulty)


FAULTS: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "depth short by 1e-3": ("depth", lambda x: x * 0.999),
    "depth along the axis": (
        "depth",
        lambda x: x * np.cos(np.linspace(-0.3, 0.3, x.shape[1])),
    ),
    "depth of misses 0": ("depth", lambda x: np.where(np.isinf(x), 0.0, x)),
    "depth of the next pixel": ("depth", lambda x: np.roll(x, 1, axis=1)),
    "id from 1": ("id", lambda x: x + 1),
    "id of misses 0": ("id", lambda x: np.maximum(x, 0)),
    "albedo of 1.03": ("albedo", lambda x: x * 1.03),
    "albedo in sRGB": ("albedo", lambda x: x**0.45),
    "albedo of the next row": ("albedo", lambda x: np.roll(x, 1, axis=0)),
    "albedo of the lamp missing": ("albedo", lambda x: np.minimum(x, 1.0)),
    "red and blue of the albedo": ("albedo", lambda x: x[..., ::-1]),
    "normal turned over": ("normal", lambda x: -x),
    "normal from 0 to 1": ("normal", lambda x: 0.5 * (x + 1.0)),
    "normal in the camera's frame": ("normal", lambda x: x[..., [0, 2, 1]]),
    "normal made unit": (
        "normal",
        lambda x: x / np.maximum(np.linalg.norm(x, axis=-1, keepdims=True), 1e-9),
    ),
    "variance of a sample": ("variance", lambda x: 8.0 * x),
    "variance with n for n - 1": ("variance", lambda x: x * 7.0 / 8.0),
    "standard error for variance": ("variance", np.sqrt),
    "no variance": ("variance", np.zeros_like),
    "a NaN in the variance": ("variance", lambda x: np.where(np.arange(3) == 1, np.nan, x)),
    "a NaN in the albedo": ("albedo", lambda x: np.where(np.arange(3) == 1, np.nan, x)),
}  # fmt: skip


@pytest.mark.cases(3)
@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_found_and_named(
    scene: Scene, tables: Any, counterpart: Any, fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, change = FAULTS[fault]
    changed_by(monkeypatch, name, change)
    found = layers(scene, tables, counterpart, film_of(scene, (name,)))
    assert found.status == "differ"
    assert name in found.reason


CAST_FAULTS: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "distance short by 1e-3": ("distance", lambda x: x * 0.999),
    "id of the next": ("id", lambda x: np.where(x >= 0, (x + 1) % 4, x)),
    "normal of 0.999": ("normal", lambda x: x * 0.999),
    "normal turned by 1e-3": ("normal", lambda x: x + 1e-3 * x[..., [1, 2, 0]]),
    "uv exchanged": ("uv", lambda x: x[..., ::-1]),
    "v from the top": ("uv", lambda x: x * [1, -1] + [0, 1]),
    "uv off by 1e-3": ("uv", lambda x: np.where(x > 0, x + 1e-3, x)),
    "colour of 0.999": ("colour", lambda x: x * 0.999),
}


@pytest.mark.parametrize("fault", [None, *CAST_FAULTS])
def test_ray_casting(
    scene: Scene, counterpart: Any, fault: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    if fault is not None:
        changed_by(monkeypatch, *CAST_FAULTS[fault])
    cast = scene.changed(integrator=RayCast(), sampler=None)
    found = layers(cast, build_tables(cast), counterpart, film_of(cast, ()))
    assert found.status == ("agree" if fault is None else "differ"), found.reason
    assert fault is None or CAST_FAULTS[fault][0] in found.reason


@pytest.mark.slow
@pytest.mark.parametrize("name", ["display_modes", "mesh_colours", "transforms", "csg_nested"])
def test_scenes_of_ray_casting_agree(name: str) -> None:
    scene = Scene.load(SCENES / f"{name}.yaml")
    film = scene.film.model_copy(update={"width": 60, "height": 40})
    scene = scene.changed(film=film)
    found = layers(scene, build_tables(scene), load(scene), film_of(scene, ()))
    assert found.status == "agree", found.reason
    assert found.numbers["unresolved"] < 0.01 * found.numbers["pixels"]


def heavy_tailed(rng: np.random.Generator, shape: tuple[int, ...], n: int) -> Any:
    """Means of n samples that are 0 in all but one of 50, and lognormal there."""
    hit = rng.uniform(size=(n, *shape)) < 0.02
    return (hit * rng.lognormal(0.0, 1.0, (n, *shape))).mean(axis=0)


@pytest.mark.parametrize("seed", range(20))
def test_means_of_one_distribution_agree(seed: int) -> None:
    rng = np.random.default_rng(seed)
    halves = [heavy_tailed(rng, (24, 32, 3), 64) for _ in range(4)]
    assert compare_means((halves[0], halves[1]), (halves[2], halves[3])).score < LIMIT


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["edges", "rare", "few edges"])
def test_false_alarms_of_means(kind: str) -> None:
    """Ours of independent samples, Mitsuba's of stratified ones: the products are not symmetric."""
    worst = 0.0
    for seed in range(400):
        rng = np.random.default_rng(seed)
        share = rng.uniform(size=(48, 64, 1)) * (0.02 if kind == "rare" else 1.0)
        if kind == "few edges":
            share *= rng.uniform(size=share.shape) < 0.05
        colour = np.array([1.0, 0.5, 0.2])
        ours = [rng.binomial(64, share) / 64 * colour for _ in range(2)]
        least = np.floor(64 * share)
        theirs = [
            (least + (rng.uniform(size=share.shape) < 64 * share - least)) / 64 * colour
            for _ in range(2)
        ]
        worst = max(worst, compare_means((ours[0], ours[1]), (theirs[0], theirs[1])).score)
    assert worst < LIMIT


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("factor", [1.0, 1.15, 0.85])
def test_variance_of_heavy_tails(seed: int, factor: float) -> None:
    rng = np.random.default_rng(seed)
    samples = rng.lognormal(0.0, 1.0, (16, 8, 32, 48, 3))
    pictures = samples.mean(axis=1)
    estimates = factor * samples.var(axis=1, ddof=1) / 8
    found = compare_spread(pictures, estimates)
    assert found.differs(upper=False) == (factor != 1.0)
    assert found.differs(upper=True) == (factor < 1.0)


HORIZON = """
camera: {type: perspective, eye: [0.3, HEIGHT, 4], target: [0.1, 0, 0], up: [0.2, 1, 0.1], fov: 50}
film: {width: 32, height: 24}
integrator: {type: ray_cast}
textures: {t: TEXTURE}
materials: {m: {type: diffuse, reflectance: t}}
shapes:
  - {type: plane, material: m, transform: [{rotate: {axis: [1, 0.01, 0.02], degrees: -89}}]}
  - {type: rectangle, material: m, transform: [{scale: 40},
     {rotate: {axis: [1, 0, 0], degrees: -90}}, {translate: [0, 0.1, 0]}]}
"""
GROUND = {
    "bilinear": "{type: bitmap, file: colours.png, uv: {offset: [0, 0]}}",
    "nearest": "{type: bitmap, file: colours.png, filter: nearest, uv: {offset: [0, 0]}}",
    "checker": "{type: checker, first: 0.2, second: 0.7, uv: {scale: 3, offset: [0, 0]}}",
}


@pytest.mark.cases(2)
@pytest.mark.parametrize("height", [0.2, 1.0, 3.0])
@pytest.mark.parametrize("name", GROUND)
def test_textures_up_to_the_horizon(name: str, height: float, image_folder: Path) -> None:
    """Where float32's error of the point that a grazing ray hits is many texels."""
    text = HORIZON.replace("TEXTURE", GROUND[name]).replace("HEIGHT", str(height))
    scene = Scene.parse(text, folder=image_folder)
    moved = Scene.parse(text.replace("offset: [0, 0]", "offset: [0.01, 0]"), folder=image_folder)
    with scalar():
        counterpart = load(scene)
        films = (scene.film, scene.film)
        found = layers(scene, scene.tables, counterpart, films)
        wrong = layers(scene, moved.tables, counterpart, films)
    assert found.status in ("agree", "reference-limited"), found.reason
    assert wrong.status == "differ"

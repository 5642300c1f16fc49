"""Ten kinds of differences between two back ends, rebuilt: each is seen, and named."""

from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

from comparisons.gate.pair import Asked, pair_case
from comparisons.gate.pictures_in import from_array
from comparisons.results.case import Case
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene

SCENE = """\
film: {width: 32, height: 32}
camera: {type: perspective, eye: [0, 0, 4], target: [0, 0, 0], fov: 40}
integrator: {type: direct}
materials:
  grey: {type: diffuse, reflectance: 0.5}
  red: {type: diffuse, reflectance: [0.6, 0.2, 0.1]}
  sheet: {type: two_sided, base: red, back: red}
  lamp: {type: emissive, radiance: [20, 16, 12]}
shapes:
  - {type: sphere, radius: 0.7, material: grey}
  - {type: sphere, center: [-0.8, 0.6, 0.4], radius: 0.3, material: red}
  - type: rectangle
    material: sheet
    transform:
      [{scale: 0.5}, {rotate: {axis: [0, 1, 0], degrees: 180}}, {translate: [0.8, -0.6, -0.5]}]
  - {type: sphere, center: [2, 2, 2], radius: 0.5, material: lamp}
lights:
  - {type: constant, radiance: [0.5, 0.4, 0.3]}
"""
"""A ball, another one beside it, and a rectangle that shows its back side."""


def rendered(scene: Scene, seed: int, spp: int = 64) -> FloatArray:
    return np.stack(
        [
            render(
                scene.changed(sampler={"type": "independent", "spp": spp, "seed": seed + k})
            ).colour
            for k in range(8)
        ]
    )


@cache
def scene() -> Scene:
    return Scene.parse(SCENE)


@cache
def right(seed: int) -> FloatArray:
    return rendered(scene(), seed)


def seen(shape: int) -> tuple[npt.NDArray[np.bool_], FloatArray]:
    """Where a shape is (height, width), and the cosine there."""
    o, d, *_ = scene().camera_rays()
    hits = scene().intersect(o, d)
    return hits.shape == shape, np.abs((hits.n * d).sum(axis=-1)) / np.linalg.norm(d, axis=-1)


def judged(
    a: FloatArray, b: FloatArray, spp: int = 64, of: Scene | None = None, rim: int = 0
) -> Case:
    return pair_case(from_array(a), from_array(b), Asked(scene=of, spp=spp, rim=rim))


def named(case: Case) -> str:
    assert case.verdict == "differ"
    assert case.cause is not None
    return case.cause.name


with_a_rim = pytest.mark.parametrize("rim", [0, 3])
"""Also pictures whose rim is left out: causes that need the scene lose theirs, too."""


@with_a_rim
def test_missing_plugin(rim: int) -> None:
    shapes = scene().shapes
    other = rendered(scene().changed(shapes=[shapes[0], *shapes[2:]]), 100)
    name = named(judged(right(0), other, of=scene(), rim=rim))
    assert name == "B's pictures are without shape 1 (sphere of the material red)"


def test_what_is_left_out_is_told() -> None:
    (note,) = [n for n in judged(right(0), right(100), rim=3).notes if "outermost" in n]
    assert "outermost 3 pixels on each side are left out" in note


@with_a_rim
def test_half_of_a_sphere_is_black(rim: int) -> None:
    on, _ = seen(0)
    half = on & (np.arange(32) < 16)
    name = named(judged(np.where(half[..., None], 0.0, right(0)), right(100), of=scene(), rim=rim))
    assert name == "shape 0 (sphere of the material grey): 50 % of it are black"


@with_a_rim
def test_index_of_materials_is_off(rim: int) -> None:
    names = list(scene().materials)
    moved = [
        s.model_copy(update={"material": names[(names.index(s.material) + 1) % 4]})
        for s in scene().shapes
    ]
    name = named(
        judged(right(0), rendered(scene().changed(shapes=moved), 100), of=scene(), rim=rim)
    )
    assert name == "B's pictures are of materials whose index is off by +1"


def test_index_of_pixels_is_off() -> None:
    moved = np.roll(right(0).reshape(8, -1, 3), 1, axis=1).reshape(right(0).shape)
    assert named(judged(moved, right(100))).startswith("shift")


@with_a_rim
def test_one_sided_rectangle(rim: int) -> None:
    on, _ = seen(2)
    name = named(judged(right(0), np.where(on[..., None], 0.0, right(100)), of=scene(), rim=rim))
    assert name == "shape 2 (rectangle of the material sheet): back sides are black"


def test_filter_at_the_border() -> None:
    weights = np.ones((32, 32, 1))
    weights[[0, -1]] *= 0.7
    weights[:, [0, -1]] *= 0.7
    assert named(judged(right(0), weights * right(0))) == "filter at the picture's border"


@with_a_rim
def test_fast_fresnel(rim: int) -> None:
    on, cosine = seen(0)
    factor = np.where(on, 1.0 + 0.5 * (1.0 - cosine) ** 5, 1.0)[..., None]
    name = named(judged(right(0), factor * right(100), of=scene(), rim=rim))
    assert name == "shape 0 (sphere of the material grey): another Fresnel term"


@pytest.mark.parametrize("seed", [0, 100], ids=["paired", "unpaired"])
def test_last_sample_is_dropped(seed: int) -> None:
    found = judged(right(0), 15.0 / 16.0 * right(seed), spp=16)
    assert named(found) == "one sample is dropped"
    assert found.cause is not None
    assert "15 of 16" in found.cause.evidence


def test_pixels_share_random_numbers() -> None:
    noise = right(100) - right(100).mean(axis=0)
    shared = right(100).mean(axis=0) + (noise + np.roll(noise, 1, axis=2)) / np.sqrt(2.0)
    (note,) = [n for n in judged(right(0), shared).notes if "share random numbers" in n]
    assert note.startswith("noise: the pixels of B's pictures")
    assert "(1, 0) apart" in note
    assert not any("share random numbers" in n for n in judged(right(0), right(100)).notes)


def test_rows_are_flipped() -> None:
    assert named(judged(right(0)[:, ::-1], right(100))) == "upside down"


def test_accumulation_in_half_floats() -> None:
    mean = right(0).mean(axis=0)
    sums = []
    for kind in (np.float64, np.float16):
        generator, pictures = np.random.default_rng(3), []
        for _ in range(8):
            total = np.zeros(mean.shape, kind)
            for _ in range(256):
                total = total + (mean * generator.gamma(0.5, 2.0, (32, 32, 1))).astype(kind)
            pictures.append(total.astype(np.float64) / 256.0)
        sums.append(np.stack(pictures))
    found = judged(*sums, spp=256)
    assert named(found) == "half floats"
    assert found.cause is not None
    assert found.cause.evidence.startswith("B's values")

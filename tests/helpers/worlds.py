"""Scenes whose light is known in advance.  All have the same tables, so that they share kernels."""

import math
from pathlib import Path

import numpy as np
import pytest
from builders import SCENES

import reference_rt as rt
from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray
from reference_rt.core.exr import write_exr

UP = np.array([0.0, 1.0, 0.0])

RHO = np.array([0.8, 0.5, 0.2])
RADIANCE = np.array([3.0, 2.0, 1.0])

NOTHING = "nothing"
TEXTURES = {
    "white and black": rt.Checker(first=(1, 1, 1), second=(0, 0, 0)),
    "black": rt.Checker(first=(0, 0, 0), second=(0, 0, 0)),
}
GOLD = {"eta": (0.14, 0.37, 1.44), "k": (3.98, 2.38, 1.6)}
MATERIALS = {
    "floor": rt.Diffuse(reflectance=tuple(RHO)),
    "silver": rt.Mirror(),
    "glass": rt.Dielectric(),
    "thin glass": rt.ThinDielectric(),
    "gold": rt.Conductor(**GOLD),
    "rough gold": rt.RoughConductor(**GOLD, alpha=0.3),
    "brushed gold": rt.RoughConductor(**GOLD, alpha=(0.1, 0.4)),
    "frosted glass": rt.RoughDielectric(alpha=0.3),
    "plastic": rt.Plastic(),
    "rough plastic": rt.RoughPlastic(alpha=0.2),
    "principled": rt.Principled(roughness=0.4, metallic=0.5, clearcoat=0.5),
    "principled thin": rt.PrincipledThin(spec_trans=0.5, diff_trans=1.0),
    "gltf": rt.GltfPbr(base_color=(0.8, 0.5, 0.2), metallic=0.5, roughness=0.4),
    "phong": rt.Phong(diffuse=0.1, specular=0.3, exponent=20.0),
    "lamp": rt.Emissive(radiance=tuple(RADIANCE)),
    "checks": rt.Diffuse(reflectance="white and black"),
    "gauze": rt.Mask(base="checks", opacity="white and black"),
    "silver on both sides": rt.TwoSided(base="silver"),
    "half gold": rt.Blend(first="gold", second="floor", weight=0.5),
    NOTHING: rt.Emissive(radiance="black"),
}


def lambert(corners: FloatArray, n: FloatArray = UP) -> float:
    """The irradiance of a polygon of radiance 1 above the horizon of the origin (Lambert 1760):
    half the sum over edges of the angle times the cosine between n and the edge's plane."""
    total = np.zeros(3)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        cross = np.cross(a, b)
        total += math.atan2(np.linalg.norm(cross), a @ b) * cross / np.linalg.norm(cross)
    return float(abs(total @ n) / 2)


def at(x: float, y: float, z: float) -> tuple:
    return (transform.Translate(translate=(x, y, z)),)


def facing(axis: tuple, degrees: float, *steps: object) -> tuple:
    """A turn, then other steps."""
    return (transform.Rotate(rotate=transform.Turn(axis=axis, degrees=degrees)), *steps)


_TINY = transform.Scale(scale=(1e-9, 1e-9, 1e-9))
# One of each shape and light, black, and too small to be met: 1e-18 of what a ray sees.
_HIDDEN_SHAPES = (
    rt.Rectangle(material=NOTHING, transform=(_TINY, *at(0.01, -0.5, 0.01))),
    rt.Sphere(center=(0.02, -0.5, 0.01), radius=1e-9, material="glass"),
    rt.Disk(transform=(_TINY, *at(0.03, -0.5, 0.01)), material="gauze"),
    rt.Triangle(v0=(0.04, -0.5, 0.01), v1=(0.04, -0.5, 0.01 + 1e-9), v2=(0.04 + 1e-9, -0.5, 0.01)),
    # Apart from the rest, so that the hierarchy has a leaf of triangles alone, which is a kind too.
    *(
        rt.Triangle(v0=(x, -9.0, 0.0), v1=(x, -9.0, 1e-9), v2=(x + 1e-9, -9.0, 0.0))
        for x in (0.0, 1e-9, 2e-9, 3e-9)
    ),
)
_HIDDEN_LIGHTS = (
    rt.Point(position=(0, -0.5, 0), intensity=0),
    rt.Spot(origin=(0, -0.5, 0), target=(0, -1, 0), intensity=0),
    rt.Projector(origin=(0, -0.5, 0), target=(0, -1, 0), up=(1, 0, 0), irradiance=0),
    rt.Directional(direction=(0, 1, 0), irradiance=0),
    rt.Ambient(radiance=0),
)
DARK = rt.EnvironmentMap(file=str(SCENES / "textures" / "sky.exr"), scale=1e-300)
"""What stands for no environment: no sum of anything notices it."""


def write_sky(path: Path) -> FloatArray:
    """A small environment map with a sun that is not tiny; what the file holds, (9, 16, 3)."""
    texels = np.random.default_rng(4).uniform(0, 1, (9, 16, 3)) ** 3
    texels[2, 5] = (9, 7, 5)
    write_exr(path, dict(zip("RGB", np.moveaxis(texels, -1, 0), strict=True)), {})
    return texels.astype(np.float32).astype(float)


FLOOR = rt.Rectangle(
    material="floor", transform=(transform.Scale(scale=(30.0, 30.0, 30.0)), *facing((1, 0, 0), -90))
)
# Looks down at the origin from just above it: every pixel sees the same point.
ORIGIN = rt.Orthographic(eye=(0, 1e-3, 0), target=(0, 0, 0), up=(0, 0, -1), width=1e-12)


def world(
    *shapes: object,
    lights: tuple = (),
    environment: object = DARK,
    materials: dict | None = None,
    textures: dict | None = None,
    pixels: int = 1024,
    spp: int = 64,
    **parts: object,
) -> rt.Scene:
    """A scene of these parts; all of its `pixels` see the origin from above, unless its camera
    sees something else."""
    given = {
        "camera": ORIGIN,
        "film": rt.Film(width=pixels, height=1),
        "sampler": rt.Sobol(spp=spp, seed=4),
        "integrator": rt.Path(max_depth=2),
        "hierarchy": "sah",
    } | parts
    if given["integrator"].deterministic and "sampler" not in parts:
        given["sampler"] = None
    return rt.Scene(
        textures=TEXTURES | (textures or {}),
        materials=MATERIALS | (materials or {}),
        shapes=(*_HIDDEN_SHAPES, *shapes),
        lights=(*_HIDDEN_LIGHTS, *lights, environment),
        **given,
    )


def estimate(scene: rt.Scene) -> tuple[FloatArray, FloatArray]:
    """(mean, standard error) over pixels, which are independent estimates of one radiance."""
    pixels = rt.render(scene).colour.reshape(-1, 3)
    return pixels.mean(axis=0), pixels.std(axis=0, ddof=1) / math.sqrt(len(pixels))


def assert_mean(scene: rt.Scene, expected: object, power: float = 5e-3) -> FloatArray:
    """Within 4 standard errors (1 in 16,000 by chance; seeds are fixed) and rounding; the standard
    error below `power` of what is expected, so that a bias of 8 times that would show.  Returns it,
    relatively."""
    expected = np.broadcast_to(np.asarray(expected, float), 3)
    mean, error = estimate(scene)
    assert (np.abs(mean - expected) <= 4 * error + 1e-12 * expected).all(), (mean, expected, error)
    assert (error <= power * expected).all(), error / expected
    return error / np.where(expected > 0, expected, 1.0)


BUDGETS = [
    pytest.param(128, 5e-3, id="2^17"),
    pytest.param(1024, 2e-3, id="2^20", marks=pytest.mark.slow),
]
"""Samples of each of 1024 pixels, which see the same; the most that the relative standard error may
be."""
budgets = pytest.mark.parametrize(("spp", "power"), BUDGETS)

"""Area lights whose irradiance has a closed form, by each sampling strategy: within 4 standard
errors.  Scenes of comparisons/truth have other closed forms: skies, textured and several lamps."""

import math

import numpy as np
import pytest
from worlds import FLOOR, RADIANCE, RHO, assert_mean, at, budgets, facing, lambert, world

import reference_rt as rt
from reference_rt.core import transform

SAMPLING = ("both", "lights", "bsdf")


def whole_sphere(center, radius):
    """pi (r / d)² cos: the irradiance of a sphere of radiance 1 wholly above the horizon."""
    d = np.linalg.norm(center)
    return math.pi * (radius / d) ** 2 * center[1] / d


def setting_sphere(center, radius):
    """The same where the horizon cuts it (Howell & Mengüç, A Catalog of Radiation Transfer
    Configuration Factors, B-43)."""
    h = np.linalg.norm(center) / radius
    cos = center[1] / np.linalg.norm(center)
    sin, root = math.sqrt(1 - cos * cos), math.sqrt(h * h - 1)
    lune = cos * math.acos(-root * cos / sin) - root * math.sqrt(1 - h * h * cos * cos)
    return math.pi / 2 - math.asin(root / (h * sin)) + lune / h**2


def level_disk(height, aside, radius):
    """That of a disk whose plane is level (Howell & Mengüç, B-13)."""
    h, r = height / aside, radius / aside
    z = 1 + h * h + r * r
    return math.pi / 2 * (1 - (z - 2 * r * r) / math.sqrt(z * z - 4 * r * r))


CORNERS = np.array([[1.0, 2.0, -0.5], [1.5, 1.0, 1.5], [-1.0, 1.5, 1.0]])
PLACE = (
    transform.Scale(scale=(1.2, 0.6, 0.3)),
    *facing((1, 0, 0), 70),
    *facing((0, 1, 0), 25),
    *at(0.6, 2.0, -0.5),
)
SQUARE = transform.apply_points(
    transform.affine(PLACE), np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]])
)
LEVEL = facing((1, 0, 0), 90)  # a front that looks down


def triangle():
    facing_origin = np.cross(CORNERS[1] - CORNERS[0], CORNERS[2] - CORNERS[0]) @ CORNERS[0] < 0
    v = [tuple(c) for c in (CORNERS if facing_origin else CORNERS[::-1])]
    return rt.Triangle(v0=v[0], v1=v[1], v2=v[2], material="lamp")


def lambert_of_a_box(m):
    """The faces that the origin sees, each by itself."""
    expected = 0.0
    for axis in range(3):
        for side in (-1.0, 1.0):
            square = np.zeros((4, 3))
            square[:, axis] = side
            square[:, (axis + 1) % 3], square[:, (axis + 2) % 3] = [-1, 1, 1, -1], [-1, -1, 1, 1]
            corners = transform.apply_points(m, square)
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            normal *= np.sign(normal @ (corners.mean(axis=0) - m[:, 3]))
            if normal @ corners[0] < 0:
                expected += lambert(corners)
    return expected


LAMPS = {
    "triangle": (triangle(), lambert(CORNERS)),
    "rectangle": (rt.Rectangle(transform=PLACE, material="lamp"), lambert(SQUARE)),
    "box": (rt.Box(transform=PLACE, material="lamp"), lambert_of_a_box(transform.affine(PLACE))),
    "sphere": (
        rt.Sphere(center=(0.5, 2, -1), radius=0.8, material="lamp"),
        whole_sphere((0.5, 2, -1), 0.8),
    ),
    "touching sphere": (
        rt.Sphere(center=(1, 1, -1), radius=1.0, material="lamp"),
        whole_sphere((1, 1, -1), 1.0),
    ),
    "setting sphere": (
        rt.Sphere(center=(1, 0.4, -1), radius=1.0, material="lamp"),
        setting_sphere((1, 0.4, -1), 1.0),
    ),
    "rising sphere": (
        rt.Sphere(center=(1, -0.3, 0.5), radius=1.0, material="lamp"),
        setting_sphere((1, -0.3, 0.5), 1.0),
    ),
    "disk": (
        rt.Disk(
            transform=(transform.Scale(scale=(0.9, 0.9, 0.9)), *LEVEL, *at(0.7, 1.5, 0)),
            material="lamp",
        ),
        level_disk(1.5, 0.7, 0.9),
    ),
}


def test_the_formulas_agree():
    """Howell's for the whole and for the cut sphere where it touches the horizon; a disk right
    above against pi r² / (r² + h²); Lambert's triangles add up."""
    assert setting_sphere((3.0, 1.0, 0.0), 1.0 + 1e-12) == pytest.approx(
        whole_sphere((3.0, 1.0, 0.0), 1.0), rel=1e-5
    )
    assert level_disk(2.0, 1e-4, 1.0) == pytest.approx(math.pi / 5, rel=1e-6)
    parts = lambert(SQUARE[[0, 1, 2]]) + lambert(SQUARE[[0, 2, 3]])
    assert lambert(SQUARE) == pytest.approx(parts, rel=1e-14)


@pytest.mark.cases(6)
@budgets
@pytest.mark.parametrize("sampling", SAMPLING)
@pytest.mark.parametrize("name", LAMPS)
def test_lamps(name, sampling, spp, power):
    lamp, irradiance = LAMPS[name]
    scene = world(FLOOR, lamp, spp=spp, integrator=rt.Path(max_depth=2, sampling=sampling))
    assert_mean(scene, RHO / math.pi * RADIANCE * irradiance, power)

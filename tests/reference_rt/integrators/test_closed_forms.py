"""Area lights whose irradiance has a closed form: within 4 standard errors."""

import math

import numpy as np
import pytest
from worlds import FLOOR, RADIANCE, RHO, assert_mean, at, budgets, facing, lambert, world, write_sky

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


@budgets
@pytest.mark.parametrize("sampling", SAMPLING)
def test_polygonal_mesh_lamp(sampling, spp, power, tmp_path):
    """An L of four triangles: Lambert's formula around its outline; and a pyramid, of which the
    origin sees some faces, each by itself."""
    flat = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2.0]])
    ell = np.column_stack([1.2 * flat[:, 0] - 1.4, 1 + 0.3 * flat[:, 1], 1.1 * flat[:, 1] - 0.7])
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    normal = np.cross(ell[1] - ell[0], ell[2] - ell[0])
    faces = faces if normal @ ell[0] < 0 else faces[:, ::-1]
    scene = world(FLOOR, mesh_lamp(tmp_path / "ell.obj", ell, faces), spp=spp,
                  integrator=rt.Path(max_depth=2, sampling=sampling))  # fmt: skip
    assert_mean(scene, RHO / math.pi * RADIANCE * lambert(ell), power)

    tip = np.array([[0.3, 0.6, 0], [1.6, 0.8, 0.3], [0.6, 2.0, 0.1], [0.7, 0.9, 1.2]])
    faces = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    inside = tip.mean(axis=0)
    expected = 0.0
    for k, face in enumerate(faces):
        a, b, c = tip[face]
        if np.cross(b - a, c - a) @ (a - inside) < 0:
            faces[k] = face[::-1]
            a, b, c = tip[faces[k]]
        if np.cross(b - a, c - a) @ a < 0:
            expected += lambert(tip[face])
    scene = world(FLOOR, mesh_lamp(tmp_path / "tip.obj", tip, faces), spp=spp,
                  integrator=rt.Path(max_depth=2, sampling=sampling))  # fmt: skip
    assert_mean(scene, RHO / math.pi * RADIANCE * expected, power)


def mesh_lamp(path, vertices, faces):
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    path.write_text("\n".join(lines + [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]))
    return rt.Mesh(file=str(path), material="lamp")


@budgets
@pytest.mark.parametrize("sampling", SAMPLING)
def test_textured_lamp(sampling, spp, power):
    """A rectangle of which the quarters on one diagonal shine, above the other two, which do not:
    each quarter by Lambert's formula."""
    lamp = rt.Rectangle(transform=PLACE, material="chequered")
    scene = world(
        FLOOR,
        lamp,
        spp=spp,
        materials={"chequered": rt.Emissive(radiance="colours")},
        textures={"colours": rt.Checker(first=(3, 2, 1), second=(0.5, 1, 2))},
        integrator=rt.Path(max_depth=2, sampling=sampling),
    )
    expected = 0.0
    for x in (-0.5, 0.5):
        for y in (-0.5, 0.5):
            square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]]) / 2 + [x, y, 0]
            corners = transform.apply_points(transform.affine(PLACE), square)
            radiance = np.array([3, 2, 1]) if x * y > 0 else np.array([0.5, 1, 2])
            expected = expected + radiance * lambert(corners)
    assert_mean(scene, RHO / math.pi * expected, power)


@budgets
@pytest.mark.parametrize("sampling", SAMPLING)
def test_all_lamps_together(sampling, spp, power):
    """Picked by power; those that do not hide each other add up."""
    names = ("triangle", "sphere", "disk")
    moved = {  # out of each other's way
        "triangle": (triangle(), lambert(CORNERS)),
        "sphere": (
            rt.Sphere(center=(-2, 2, -2), radius=0.8, material="lamp"),
            whole_sphere((-2, 2, -2), 0.8),
        ),
        "disk": (
            rt.Disk(
                transform=(transform.Scale(scale=(0.4, 0.4, 0.4)), *LEVEL, *at(0.7, 0.6, -1.0)),
                material="lamp",
            ),
            level_disk(0.6, math.hypot(0.7, 1.0), 0.4),
        ),
    }
    lamps = [moved[name] for name in names]
    scene = world(FLOOR, *(lamp for lamp, _ in lamps), spp=spp,
                  integrator=rt.Path(max_depth=2, sampling=sampling))  # fmt: skip
    irradiance = sum(value for _, value in lamps)
    assert_mean(scene, RHO / math.pi * RADIANCE * irradiance, power)


@pytest.mark.cases(1)
@budgets
@pytest.mark.parametrize("sampling", SAMPLING)
def test_environment_map(sampling, spp, power, tmp_path):
    """Against a quadrature of the image, turned: a million cosine-distributed directions, midpoints
    of a grid."""
    texels = write_sky(tmp_path / "sky.exr")
    turn = facing((1, 2, 2), 77)
    ticks = (np.arange(1000) + 0.5) / 1000
    u, v = np.meshgrid(ticks, ticks)
    r, phi = np.sqrt(u), 2 * math.pi * v
    d = np.stack([r * np.cos(phi), np.sqrt(1 - u), r * np.sin(phi)], axis=-1)
    irradiance = math.pi * bilinear(texels, d @ transform.affine(turn)[:, :3]).mean(axis=(0, 1))
    scene = world(
        FLOOR,
        spp=spp,
        environment=rt.EnvironmentMap(file=str(tmp_path / "sky.exr"), transform=turn),
        integrator=rt.Path(max_depth=2, sampling=sampling),
    )
    # The midpoint rule is of second order, on a function with kinks: some 1e-6.
    error = assert_mean(scene, RHO / math.pi * irradiance, power)
    assert error.min() > 1e-5


def bilinear(texels, d):
    """The documented map: top row at +y, bottom row at -y, middle of the width at +z, -x to its
    right."""
    height, width = texels.shape[:2]
    x = (np.arctan2(-d[..., 0], d[..., 2]) / (2 * math.pi) + 0.5) * width - 0.5
    y = np.arccos(np.clip(d[..., 1], -1, 1)) / math.pi * (height - 1)
    i, j = np.floor(x).astype(int), np.minimum(y.astype(int), height - 2)
    s, t = (x - i)[..., None], (y - j)[..., None]
    left, right = i % width, (i + 1) % width
    upper = texels[j, left] * (1 - s) + texels[j, right] * s
    return upper * (1 - t) + (texels[j + 1, left] * (1 - s) + texels[j + 1, right] * s) * t

"""Disks: texture coordinates, bounds, disks as lights."""

import itertools
import math

import numpy as np
import pytest
from builders import U
from placed_shapes import plane_points, random_map

import reference_rt as rt
from reference_rt.core import transform
from reference_rt.rendering import query
from reference_rt.shapes import DISK
from reference_rt.shapes.flat import disk
from reference_rt.shapes.shape import TabulationContext


def test_uv_along_the_axes():
    """(r, phi / 2 pi), phi from local +x towards +y."""
    scene = rt.Scene(shapes=(rt.Disk(),))
    o = [[0.5, 0, 1], [0, 0.5, 1], [-0.25, 0, 1], [0, -1, 1], [0, 0, 1]]
    hits = scene.intersect(o, [[0, 0, -1]] * 5)
    assert hits.uv.tolist() == [[0.5, 0], [0.5, 0.25], [0.25, 0.5], [1, 0.75], [0, 0]]


def test_bounds_touch_the_rim():
    rng = np.random.default_rng(4)
    for _ in range(30):
        table = rt.Disk(transform=(random_map(rng, 2.0, 3.0),)).tabulate(TabulationContext())
        phi = np.linspace(0, 2 * math.pi, 100_001)
        points = plane_points(table, np.zeros(len(phi), int), np.cos(phi), np.sin(phi))
        (lower,), (upper,) = disk.bounds(table)
        size = np.abs(points).max() + np.abs(table.center).max()
        # Rounding of the points themselves; the rim between two of them, (1e-4)² / 16 of it.
        assert (points >= lower - 4 * U * size).all()
        assert (points <= upper + 4 * U * size).all()
        assert (points.min(axis=0) - lower).max() <= 1e-9 * size
        assert (upper - points.max(axis=0)).max() <= 1e-9 * size


# ---- as a light ---------------------------------------------------------------------------------


def lamp(*steps):
    """A disk that shines on a floor of reflectance 0.5 at z = 0."""
    return rt.Scene(
        materials={"lamp": rt.Emissive(radiance=(2, 2, 2))},
        shapes=(
            rt.Disk(material="lamp", transform=steps),
            rt.Rectangle(transform=(transform.Scale(scale=(9, 9, 9)),)),
        ),
    )


def samples(scene, u):
    """(points, pdf, contributions) of the light at the floor's middle."""
    o, d = [[0.0, 0.0, 0.01]], [[0.0, 0.0, -1.0]]
    found = [query.direct_light(scene.tables, o, d, 0, tuple(k)) for k in u]
    return (
        np.concatenate([getattr(f, k) for f in found]) for k in ("target", "pdf", "contribution")
    )


def midpoints(n):
    ticks = (np.arange(n) + 0.5) / n
    return itertools.product(ticks, ticks)


def test_the_back_does_not_shine():
    scene = lamp(transform.Translate(translate=(0, 0, 2)))
    _, pdf, light = samples(scene, midpoints(3))
    assert not pdf.any()
    assert not light.any()


def test_the_pdf_is_that_of_the_samples():
    """What a path that meets the light by chance weighs itself against."""
    step = random_map(np.random.default_rng(7), 0.3, 0.0)
    scene = lamp(step, transform.Translate(translate=(0, 0, 5)))
    areas = scene.tables.lights.areas
    m = transform.affine(scene.shapes[0].transform)
    area = math.pi * np.linalg.norm(np.cross(m[:, 0], m[:, 1]))
    assert areas.area[areas.kind == DISK][0] == pytest.approx(area, rel=8 * U)


# ---- what is refused ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("factors", "message"),
    [
        (
            (1, 0, 1),
            "the transform is singular: it flattens space; expected one that can be undone",
        ),
        ((1e200, 1e200, 1), "the disk's area is not a float64; expected an ordinary size"),
        ((1e-200, 1e-200, 1), "the disk's area is not a float64; expected an ordinary size"),
    ],
)
def test_bad_maps(factors, message):
    scene = rt.Scene(shapes=(rt.Disk(transform=(transform.Scale(scale=factors),)),))
    with pytest.raises(rt.SceneError, match=message):
        rt.build_tables(scene)

"""Shapes as triangles for Cycles: where ours are, facing as ours do, with our uv."""

from pathlib import Path

import numpy as np
import pytest

import reference_rt as rt
from comparisons.cycles.surfaces import placed_arrays, triangles_of
from comparisons.geometry import affine
from comparisons.materials import type_of as type_of_material
from comparisons.renderers import NoCounterpartError
from comparisons.shapes import type_of
from comparisons.shapes.fine import FINE
from reference_rt.core.transform import Matrix, Rotate, Scale, Translate
from reference_rt.scene.examples import examples
from reference_rt.shapes import Primitive

EXAMPLES = examples(Primitive)
SHAPES = [shape for shape in EXAMPLES if type_of(shape).to_cycles is not None]

MAPS = {
    "none": (),
    "moved": (Rotate(rotate={"axis": (1, 2, 3), "degrees": 50}), Translate(translate=(3, -1, 2))),
    "mirrored": (Scale(scale=(-1, 1, 1)), Rotate(rotate={"axis": (0, 1, 1), "degrees": 20})),
    "sheared": (Matrix(matrix=((1, 0.4, 0, 0), (0, 0.7, 0.2, 1), (0.1, 0, 1.3, 0))),),
}

OFF = 4.0 * (1.0 - np.cos(np.pi / FINE))
"""How far, over the radius, a triangle may lie off a surface that is curved along u and v."""


@pytest.mark.cases(len(SHAPES))
@pytest.mark.parametrize("steps", MAPS)
@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.type)
def test_rays_hit_ours_where_the_triangles_are(shape, steps):
    shape = shape.model_copy(update={"transform": MAPS[steps]})
    surface = triangles_of(shape, Path())
    m = affine.of_steps(shape.transform)
    placed = placed_arrays(surface, m)
    rng = np.random.default_rng(5)
    chosen = rng.integers(len(surface.faces), size=200)
    corners = placed["vertices"][placed["faces"][chosen]]
    weights = rng.dirichlet([1.0, 1.0, 1.0], len(chosen))[:, :, None]
    p = (weights * corners).sum(axis=1)
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    reach = 0.01 * np.abs(corners).max()  # outwards, past the triangle
    hits = rt.Scene(shapes=(shape,)).intersect(p + reach * n, -n, t_max=2.0 * reach)
    hit = hits.shape == 0
    assert hit.mean() > 0.97  # near a rim triangles reach beyond it
    off = np.abs(hits.t[hit] - reach)
    assert np.quantile(off, 0.97) < 3.0 * OFF
    assert (np.sum(hits.n[hit] * n[hit], axis=1) > 0.99).mean() > 0.97
    if "normals" in placed:
        smooth = (weights * placed["normals"].reshape(-1, 3, 3)[chosen]).sum(axis=1)
        smooth /= np.linalg.norm(smooth, axis=1, keepdims=True)
        assert np.quantile(1.0 - np.sum(hits.ns[hit] * smooth[hit], axis=1), 0.97) < 1e-3
    if "uv" in placed:
        uv = (weights * placed["uv"].reshape(-1, 3, 2)[chosen]).sum(axis=1)
        assert np.quantile(np.abs(hits.uv[hit] - uv[hit]), 0.95) < 2.0 / FINE


@pytest.mark.parametrize(
    ("shape", "volume"),
    [
        (rt.Sphere(center=(0.3, -0.2, 0.1), radius=0.7), 4.0 / 3.0 * np.pi * 0.7**3),
        (rt.Box(), 8.0),
        (rt.Cylinder(radius=0.5, z_min=-0.4, z_max=0.9), np.pi * 0.25 * 1.3),
        (rt.Cone(radius=0.8, height=1.3), np.pi * 0.64 * 1.3 / 3.0),
        (
            rt.Cone(radius=0.4, height=1.1, top_radius=0.7),
            np.pi * 1.1 / 3.0 * (0.16 + 0.28 + 0.49),
        ),
        (rt.Torus(major_radius=1.0, minor_radius=0.3), 2.0 * np.pi**2 * 0.09),
    ],
)
def test_volumes(shape, volume):
    """By the divergence theorem: no triangle is missing, doubled or turned."""
    surface = triangles_of(shape, Path())
    a, b, c = (surface.positions[surface.faces[:, k]] for k in range(3))
    found = np.sum(a * np.cross(b, c)) / 6.0
    assert found == pytest.approx(volume, rel=3.0 * OFF)


@pytest.mark.parametrize("shape", [shape for shape in EXAMPLES if shape not in SHAPES])
def test_others_do_not_vote(shape):
    with pytest.raises(NoCounterpartError, match=shape.type):
        triangles_of(shape, Path())


def test_cycles_squares_the_roughness_of_metals() -> None:
    """Its microfacets have alpha = roughness² (Cycles' manual, "Metallic BSDF")."""
    alpha = 0.04
    metal = rt.RoughConductor(eta=0.2, k=3.0, alpha=(alpha, alpha))
    shader = type_of_material(metal).to_cycles(metal, None)
    assert shader["front"]["roughness"] == pytest.approx(0.2, rel=1e-15)

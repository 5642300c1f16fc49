"""Meshes with float32 vertices: what Mitsuba holds is what we have, and nothing else changes."""

import warnings
from typing import Any

import numpy as np
import pytest

from comparisons.mitsuba.backend import mitsuba
from comparisons.referee.sizes import ShapeSizes
from comparisons.rungs import whitted
from comparisons.translator import load
from comparisons.translator.moved import frame_of, with_float32_vertices
from reference_rt import Dielectric, Film, Mesh, Point, Scene, Sphere, Triangle, Whitted
from reference_rt.core.transform import Rotate, Scale, Translate, Turn
from reference_rt.rendering import query
from reference_rt.scene.build import build_tables
from reference_rt.shapes.shape import TabulationContext

TURN = Rotate(rotate=Turn(axis=(0.2, 1.0, 0.1), degrees=33.0))
STEPS = {
    "turned": (Scale(scale=(0.9, 0.9, 0.9)), TURN),
    "mirrored": (Scale(scale=(-0.7, 1.1, 0.9)), TURN),
    "moved": (TURN, Translate(translate=(0.137, -0.3, 0.071))),
    "tiny": (Scale(scale=(1e-5, 1e-5, 1e-5)), TURN),
}


def arrays(n: int = 12) -> dict[str, Any]:
    """A bumpy ball of 4 n² triangles."""
    u, v = np.meshgrid(np.linspace(0, 1, 2 * n + 1), np.linspace(0.02, 0.98, n + 1))
    r = 1.0 + 0.05 * np.sin(40 * u) * np.sin(31 * v)
    polar, azimuth = np.pi * v, 2.0 * np.pi * u
    p = np.stack([np.sin(polar) * np.cos(azimuth), np.cos(polar), np.sin(polar) * np.sin(azimuth)])
    k = (np.arange(n)[:, None] * (2 * n + 1) + np.arange(2 * n)).ravel()
    faces = np.concatenate(
        [
            np.column_stack([k, k + 1, k + 2 * n + 2]),
            np.column_stack([k, k + 2 * n + 2, k + 2 * n + 1]),
        ]
    )
    return {"vertices": (r * p).reshape(3, -1).T, "faces": faces}


def meshes() -> dict[str, Any]:
    plain = arrays()
    n = plain["vertices"]
    uv = np.column_stack([n[:, 0], n[:, 1]])
    cut = plain["faces"].copy()
    cut[5] = cut[5, 0]  # no area: left out, but counted
    return {
        "plain": Mesh(**plain),
        "smooth": Mesh(**plain, smooth=True),
        "normals": Mesh(**plain, normals=n),
        "flat": Mesh(**plain, normals=n, face_normals=True),
        "uv": Mesh(**plain, uv=uv),
        "all": Mesh(**plain, normals=n, uv=uv, colours=np.abs(n)),
        "without a face": Mesh(vertices=n, faces=cut, normals=n),
        "triangle": Triangle(v0=(-1, -0.9, 0.1), v1=(1.1, -0.7, 0), v2=(0.1, 1.2, 0.2)),
    }


def scene_of(name: str, steps: str) -> Scene:
    shape = meshes()[name].model_copy(update={"transform": STEPS[steps]})
    return Scene(film=Film(width=16, height=12), shapes=(shape,))


@pytest.mark.filterwarnings("ignore::reference_rt.SceneWarning")
@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("name", meshes())
def test_mitsuba_holds_our_vertices_and_nothing_else_changes(name: str, steps: str) -> None:
    scene = scene_of(name, steps)
    rounded, moved, _ = with_float32_vertices(scene)
    tables = [s.shapes[0].tabulate(TabulationContext()) for s in (scene, rounded)]
    frame = frame_of(rounded)
    assert frame == frame_of(scene)
    held = frame.into(tables[1].vertices.reshape(-1, 3))
    counterpart = load(rounded)
    (shape,) = counterpart.mi_scene.shapes()
    theirs = np.array(mitsuba().traverse(shape)["vertex_positions"]).reshape(-1, 3)
    assert np.array_equal(held.astype(np.float32), theirs)
    assert np.abs(held - theirs).max() <= 2.0**-50 * np.abs(frame.center).max() * frame.scale
    # Half of a unit in the last place, in each coordinate.
    size = frame.largest(tables[0].vertices.reshape(-1, 3)).max()
    assert 0.0 < moved <= np.sqrt(3.0) * 2.0**-24 * size
    assert np.abs(tables[1].vertices - tables[0].vertices).max() <= moved
    for field in ("face", "uvs", "colours", "material", "owner"):
        a, b = (getattr(table, field) for table in tables)
        assert (a is None) == (b is None), field
        assert a is None or np.array_equal(a, b), field
    a, b = (table.normals for table in tables)
    assert (a is None) == (b is None)
    assert a is None or np.abs(a - b).max() <= 1e-15


@pytest.mark.parametrize("name", meshes())
def test_meshes_that_float32_would_break_stay(name: str) -> None:
    shape = meshes()[name].model_copy(
        update={"transform": (TURN, Translate(translate=(1e6 + 0.1, 2e5, -3e5)))}
    )
    scene = Scene(film=Film(width=16, height=12), shapes=(shape, Sphere()))
    assert frame_of(scene).is_ours
    rounded, moved, _ = with_float32_vertices(scene)
    assert rounded is scene
    assert moved == 0.0


def test_scenes_without_meshes_and_rounded_ones_stay() -> None:
    ball = Scene(shapes=(Sphere(),))
    assert with_float32_vertices(ball)[:2] == (ball, 0.0)
    once, moved, _ = with_float32_vertices(scene_of("all", "turned"))
    assert moved > 0.0
    again, rest, _ = with_float32_vertices(once)
    assert again is once
    assert rest == 0.0


def test_warnings_stay() -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        with_float32_vertices(scene_of("without a face", "turned"))
    assert any("have no area" in str(w.message) for w in caught)


def test_a_fine_mesh_of_glass_agrees() -> None:
    """Glass amplifies the tilt of normals: with float64 vertices more rays need the arbiter."""
    shape = Mesh(**arrays(80), material="glass", transform=STEPS["moved"])
    scene = Scene(
        film=Film(width=64, height=48),
        integrator=Whitted(max_depth=6),
        materials={"glass": Dielectric(interior_ior=1.5)},
        shapes=(shape, Sphere(center=(0.2, 0.1, 2.0), radius=0.7, material="glass")),
        lights=(Point(position=(2, 4, 3), intensity=(30, 30, 30)),),
        camera={"type": "perspective", "eye": (0.3, 0.4, 5.0), "target": (0.1, 0, 0), "fov": 36},
    )
    rounded, _, _ = with_float32_vertices(scene)
    found = [whitted(s, build_tables(s), load(s), 1000) for s in (scene, rounded)]
    assert found[1].status in ("agree", "not-applicable"), found[1].reason
    assert found[1].numbers["explained"] <= found[0].numbers["explained"]


def test_the_frame_of_hits_is_kept() -> None:
    """Rays through the middles of triangles hit the same ones, at nearly the same points."""
    scene = scene_of("normals", "moved")
    rounded, moved, _ = with_float32_vertices(scene)
    before, after = build_tables(scene), build_tables(rounded)
    corners = ShapeSizes(scene).leaves[0].table.vertices.reshape(-1, 3, 3)
    p = corners.mean(axis=1)
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    n /= np.linalg.norm(n, axis=1)[:, None]
    one, two = (query.intersect(tables, p + 0.01 * n, -n) for tables in (before, after))
    assert np.array_equal(one.primitive, two.primitive)
    assert np.abs(one.t - two.t).max() <= 4.0 * moved
    assert np.abs(one.ns - two.ns).max() <= 1e-5

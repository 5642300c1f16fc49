"""Shadow rays in the rung of geometry: right ones agree; one lost triangle of many is found."""

from typing import Any

import numpy as np
import pytest

from comparisons.referee.sizes import ShapeSizes
from comparisons.rungs import geometry
from comparisons.rungs.rays import any_hit
from comparisons.rungs.rays.rays import mixed_rays
from comparisons.translator import load
from reference_rt import Film, Instance, Mesh, Scene, Sphere
from reference_rt.core.transform import Scale, Translate
from reference_rt.rendering import query
from reference_rt.rendering.query.tracing import FEW
from reference_rt.scene.build import build_tables

SIDE = 20


def hills(without: int | None = None) -> Mesh:
    """A height field of 800 triangles, without one of them."""
    y, x = np.mgrid[0 : SIDE + 1, 0 : SIDE + 1] / SIDE
    z = 0.1 * np.sin(9 * x) * np.cos(7 * y)
    corner = (np.arange(SIDE)[:, None] * (SIDE + 1) + np.arange(SIDE)).ravel()
    faces = np.concatenate(
        [
            np.column_stack([corner, corner + 1, corner + SIDE + 2]),
            np.column_stack([corner, corner + SIDE + 2, corner + SIDE + 1]),
        ]
    )
    if without is not None:
        faces = np.delete(faces, without, axis=0)
    vertices = np.column_stack([x.ravel(), y.ravel(), z.ravel()]).astype(np.float32)
    return Mesh(vertices=vertices.astype(np.float64), faces=faces)


def scene_of(mesh: Mesh, instanced: bool = False) -> Scene:
    film = Film(width=16, height=16)
    ball = Sphere(center=(0.5, 0.5, 0.6), radius=0.2)
    if not instanced:
        return Scene(film=film, shapes=(mesh, ball))
    steps = (Scale(scale=(1.0, -2.0, 0.5)), Translate(translate=(0.0, 0.0, -0.5)))
    copies = Instance(group="hills"), Instance(group="hills", transform=steps)
    return Scene(film=film, shapes=(*copies, ball), groups={"hills": (mesh,)})


def checked(scene: Scene, tables: Any) -> any_hit.AnyHits:
    counterpart = load(scene)
    sizes = ShapeSizes(scene, counterpart.frame)
    rays = mixed_rays(scene, tables, sizes, 200, 0)
    hits = query.intersect(tables, rays.o, rays.d)
    return any_hit.any_hits(tables, counterpart, sizes, rays, hits, 0)


@pytest.mark.parametrize("instanced", [False, True])
def test_right_shadow_rays_agree(instanced: bool) -> None:
    scene = scene_of(hills(), instanced)
    found = checked(scene, build_tables(scene))
    assert (found.wrong, found.first, found.mitsuba_wrong) == (0, "", 0)
    assert found.triangles == 2 * SIDE * SIDE * (2 if instanced else 1)
    assert found.rays > 2 * found.triangles


@pytest.mark.parametrize("lost", [0, 1, 137, 400, 799])
@pytest.mark.parametrize("way", ["blocks", "single", "closest"])
def test_one_lost_triangle_is_found(lost: int, way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scene_of(hills())
    tables, faulty = build_tables(scene), build_tables(scene_of(hills(lost)))
    occluded, first_hits = query.occluded, query.first_hits

    def shadow(right: Any, o: Any, *others: Any) -> Any:
        wrong = way == ("blocks" if len(o) > FEW else "single")
        return occluded(faulty if wrong else right, o, *others)

    def closest(right: Any, *others: Any) -> Any:
        return first_hits(faulty if way == "closest" else right, *others)

    monkeypatch.setattr(query, "occluded", shadow)
    monkeypatch.setattr(query, "first_hits", closest)
    found = checked(scene, tables)
    assert found.wrong > 0
    assert {"blocks": "by blocks", "single": "ray by ray", "closest": "closest hit"}[way] in (
        found.first
    )


def test_the_rung_differs(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scene_of(hills())
    tables, faulty = build_tables(scene), build_tables(scene_of(hills(321)))
    occluded = query.occluded
    monkeypatch.setattr(query, "occluded", lambda right, *others: occluded(faulty, *others))
    found = geometry(scene, tables, load(scene), pixels=100)
    assert found.status == "differ"
    assert "shadow rays are wrong" in found.reason


def test_shadow_rays_that_see_too_much(monkeypatch: pytest.MonkeyPatch) -> None:
    """Any-hit that ignores the end of the ray."""
    scene = scene_of(hills())
    occluded = query.occluded
    monkeypatch.setattr(query, "occluded", lambda tables, o, d, t_max: occluded(tables, o, d))
    assert "up to the closest hit" in checked(scene, build_tables(scene)).first

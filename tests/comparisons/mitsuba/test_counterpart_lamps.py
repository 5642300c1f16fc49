"""Meshes that shine by a texture: their light is that of Mitsuba's counterpart, also where several
triangles share uv, or use a part of the texture only."""

import numpy as np
import pytest

import reference_rt as rt
from comparisons.mitsuba.scene import render
from comparisons.mitsuba.translate import UntranslatableError, load
from comparisons.rungs import direct
from reference_rt.rendering.scene import Scene

CORNERS = {
    "whole": [[0, 0], [1, 0], [1, 1], [0, 1]],
    "a part": [[0.1, 0.1], [0.3, 0.1], [0.3, 0.4], [0.1, 0.4]],
    "one place": [[0.3, 0.6]] * 4,
    "repeated": [[0, 0], [3, 0], [3, 2], [0, 2]],
}


def scene_with(uv: list[list[float]] | None, texture: rt.Checker | rt.VertexColours) -> Scene:
    """Two quads above a floor, turned to it."""
    x = np.array([[-1.0, 2.0, -1.0], [1.0, 2.0, -1.0], [1.0, 2.2, 1.0], [-1.0, 2.2, 1.0]])
    vertices = np.concatenate([0.5 * x, 0.3 * x + [1.5, 0.5, 0.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    lamp = rt.Mesh(
        vertices=vertices,
        faces=faces,
        uv=None if uv is None else np.array(uv * 2, np.float64),
        colours=np.full((8, 3), 0.5),
        material="lamp",
    )
    floor = rt.Rectangle(transform=({"scale": 4}, {"rotate": {"axis": (1, 0, 0), "degrees": -90}}))
    return Scene(
        camera=rt.Perspective(eye=(0, 3, 6), target=(0, 0.6, 0), fov=50),
        film=rt.Film(width=24, height=16),
        sampler=rt.Sobol(spp=256),
        integrator=rt.Path(max_depth=3),
        textures={"t": texture},
        materials={"lamp": rt.Emissive(radiance="t")},
        shapes=(floor, lamp),
    )


@pytest.mark.parametrize("name", [*CORNERS, "none"])
def test_textured_meshes_shine_alike(name: str) -> None:
    texture = rt.Checker(first=9.0, second=(1.0, 0.5, 0.2))
    scene = scene_with(CORNERS.get(name), texture)
    counterpart = load(scene)
    rung = direct(scene, scene.tables, counterpart, 1000)
    assert rung.status == "agree", rung.reason
    ours = np.stack(
        [
            rt.render(scene.changed(sampler=rt.Sobol(spp=256, seed=k)), specialised=False).colour
            for k in range(8)
        ]
    )
    theirs = render(counterpart.mi_scene, 8, 256).pictures
    assert ours.mean() > 0.002
    # Means of pictures, over eight seeds each; 5.5 standard errors for 15 such numbers.
    a, b = ours.mean(axis=(1, 2)), theirs.mean(axis=(1, 2))
    error = np.sqrt((a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)) / 8.0)
    off = np.abs(a.mean(axis=0) - b.mean(axis=0))
    assert (off <= 5.5 * error).all()
    assert (error < 0.01 * a.mean(axis=0)).all()


def test_colours_of_vertices_are_refused() -> None:
    with pytest.raises(UntranslatableError, match="colours of its vertices"):
        load(scene_with(CORNERS["whole"], rt.VertexColours(scale=1.0)))

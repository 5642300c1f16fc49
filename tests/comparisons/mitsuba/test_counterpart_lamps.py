"""Shapes that emit: their light is that of Mitsuba's counterpart, also where several triangles
share uv, with colours or normals of vertices, textures on boxes and curved shapes, in instances."""

from typing import Any

import numpy as np
import pytest
from counterparts import coarse_meshes

import reference_rt as rt
from comparisons.mitsuba.scene import render
from comparisons.mitsuba.translate import load
from comparisons.rungs import direct, whitted
from reference_rt.rendering.scene import Scene

CORNERS = {
    "whole": [[0, 0], [1, 0], [1, 1], [0, 1]],
    "a part": [[0.1, 0.1], [0.3, 0.1], [0.3, 0.4], [0.1, 0.4]],
    "one place": [[0.3, 0.6]] * 4,
    "repeated": [[0, 0], [3, 0], [3, 2], [0, 2]],
}
CHECKER = rt.Checker(first=9.0, second=(1.0, 0.5, 0.2), uv={"offset": (0.13, 0.21)})
"""Shifted: middles of faces, which Whitted ray tracing takes, are on no edge of its squares."""
FLOOR = rt.Rectangle(transform=({"scale": 4}, {"rotate": {"axis": (1, 0, 0), "degrees": -90}}))


def quads(**columns: Any) -> rt.Mesh:
    """Two quads, turned down."""
    x = np.array([[-1.0, 2.0, -1.0], [1.0, 2.0, -1.0], [1.0, 2.2, 1.0], [-1.0, 2.2, 1.0]])
    vertices = np.concatenate([0.5 * x, 0.3 * x + [1.5, 0.5, 0.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    return rt.Mesh(vertices=vertices, faces=faces, material="lamp", **columns)


def scene_with(
    *shapes: Any, texture: Any = None, groups: dict[str, Any] | None = None, **lamp: Any
) -> Scene:
    """Lamps above a floor."""
    return Scene(
        camera=rt.Perspective(eye=(0, 3, 6), target=(0, 0.6, 0), fov=50),
        film=rt.Film(width=24, height=16),
        sampler=rt.Sobol(spp=256),
        integrator=rt.Path(max_depth=3),
        textures={} if texture is None else {"t": texture},
        materials={"lamp": rt.Emissive(**{"radiance": "t" if texture else (9, 6, 3), **lamp})},
        shapes=(FLOOR, *shapes),
        groups=groups or {},
    )


def check_light(scene: Scene, most: float = 0.01, samples: int = 256) -> None:
    """Direct light value by value, Whitted ray tracing pixel by pixel, and means of pictures."""
    counterpart = load(scene)
    for rung in (direct, whitted):
        found = rung(scene, scene.tables, counterpart, 1000)
        assert found.status in ("agree", "not-applicable"), found.reason
    ours = np.stack(
        [
            rt.render(
                scene.changed(sampler=rt.Sobol(spp=samples, seed=k)), specialised=False
            ).colour
            for k in range(8)
        ]
    )
    theirs = render(counterpart.mi_scene, 8, samples).pictures
    assert ours.mean() > 0.002
    # Means of pictures, over eight seeds each; 5.5 standard errors for 15 such numbers.
    a, b = ours.mean(axis=(1, 2)), theirs.mean(axis=(1, 2))
    error = np.sqrt((a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)) / 8.0)
    off = np.abs(a.mean(axis=0) - b.mean(axis=0))
    assert (off <= 5.5 * error).all()
    assert (error < most * a.mean(axis=0)).all()


@pytest.mark.parametrize("name", [*CORNERS, "none"])
def test_textured_meshes(name: str) -> None:
    uv = None if name == "none" else np.array(CORNERS[name] * 2, np.float64)
    check_light(scene_with(quads(uv=uv), texture=CHECKER))


def test_colours_of_vertices() -> None:
    colours = np.linspace(0.1, 1.0, 24).reshape(8, 3)
    check_light(scene_with(quads(colours=colours), texture=rt.VertexColours(scale=9.0)))


@pytest.mark.parametrize("radiance", ["constant", "textured"])
def test_normals_of_vertices(radiance: str) -> None:
    """The triangle's normal decides which side shines, and how much reaches a point."""
    n = np.array([[0.9, -1, 0], [-0.9, -1, 0.2], [0.1, -1, 0.8], [0, 0.4, -1]] * 2)
    n /= np.linalg.norm(n, axis=1)[:, None]
    uv = np.array(CORNERS["a part"] * 2, np.float64)
    lamp = quads(uv=uv, normals=n)
    check_light(scene_with(lamp, texture=CHECKER if radiance == "textured" else None))


BENT = {"matrix": ((0.8, 0.3, 0, 0), (0, 0.5, 0.2, 1.7), (0.1, 0, 0.9, 0))}
MIRRORED = {"matrix": ((-0.8, 0.3, 0, 0.5), (0, 0.5, 0.2, 1.7), (0.1, 0, 0.9, 0))}


@pytest.mark.parametrize("map_", [BENT, MIRRORED])
def test_textured_boxes(map_: Any) -> None:
    box = rt.Box(material="lamp", transform=({"scale": (0.8, 0.5, 0.6)}, map_))
    check_light(scene_with(box, texture=CHECKER))


@pytest.mark.parametrize(
    ("shape", "is_textured"),
    [
        (rt.Cone(material="lamp", transform=(BENT,)), True),
        (rt.Sphere(material="lamp", radius=0.6, transform=(MIRRORED,)), False),
        pytest.param(
            rt.Cylinder(material="lamp", radius=0.6, transform=(BENT,)),
            False,
            marks=pytest.mark.slow,
        ),
        pytest.param(
            rt.Torus(material="lamp", major_radius=0.7, transform=(MIRRORED,)),
            True,
            marks=pytest.mark.slow,
        ),
    ],
)
def test_curved_lamps_under_any_map(shape: Any, is_textured: bool) -> None:
    # Rays that are scattered find them, no light sample does.
    with coarse_meshes(256, 128):
        check_light(scene_with(shape, texture=CHECKER if is_textured else None), most=0.03)


@pytest.mark.parametrize("is_textured", [False, True])
def test_instances_that_emit(is_textured: bool) -> None:
    members = [quads(uv=np.array(CORNERS["whole"] * 2, np.float64))]
    if not is_textured:
        ball = rt.Sphere(material="lamp", radius=0.5, center=(-1.5, 1.5, 0))
        members += [ball, rt.Box(material="lamp", transform=({"scale": 0.2}, BENT))]
    near = {"translate": (0, 0, 1.5)}
    shapes = [
        rt.Instance(group="lamps", transform=(step,))
        for step in ({"scale": (1, 0.9, 1.1)}, near, {"scale": (-1, 1.1, 1)})
    ]
    texture = CHECKER if is_textured else None
    scene = scene_with(*shapes, texture=texture, groups={"lamps": tuple(members)})
    check_light(scene, most=0.03)

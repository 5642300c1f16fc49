"""Lights that lie on a surface, such as a ceiling: it does not hide them."""

import numpy as np
import pytest

from reference_rt.core.ray import SurfacePoint, segment_to
from reference_rt.core.transform import rotate
from reference_rt.core.vec3 import Vec3
from reference_rt.rendering import query
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene

UP = Vec3(0.0, 0.0, 1.0)
SHAPES = {
    "plane": "{type: plane, TURN}",
    "rectangle": "{type: rectangle, TURN}",
    "disk": "{type: disk, TURN}",
    "triangle": "{type: triangle, v0: [-1, -1, 0], v1: [1, -1, 0], v2: [0, 1, 0], TURN}",
    "polygon": "{type: polygon, rings: [[[-1, -1], [1, -1], [1, 1], [-1, 0.5]]], TURN}",
    "mesh": "{type: mesh, vertices: [[-1, -1, 0], [1, -1, 0], [0, 1, 0.5], [0, 0, -1]],"
    " faces: [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]], TURN}",
    "box": "{type: box, TURN}",
    "sphere": "{type: sphere, TURN}",
    "cylinder": "{type: cylinder, TURN}",
    "cone": "{type: cone, TURN}",
    "torus": "{type: torus, major_radius: 1, minor_radius: 0.4, TURN}",
    "quadric": "{type: quadric, coefficients: [1, 2, 0, 0, 0, 0, 0, 0, -1, 0], lower: [-1, -1, 0],"
    " upper: [1, 1, 1], capped: false, TURN}",
    "solid": "{type: difference, of: [{type: sphere}, {type: box, transform: [{translate: [1, 1,"
    " 1]}]}], TURN}",
    "instance": "{type: instance, group: g, TURN}",
}
ON_IT = """
groups: {{g: [{{type: mesh, vertices: [[-1, -1, 0], [1, -1, 0], [0, 1, 0]], faces: [[0, 1, 2]]}}]}}
shapes: [{shape}]
"""


def turned(rng, size):
    """A map that turns, stretches and moves, as text, and where it moves to."""
    axis, move = rng.normal(size=3).round(3), size * rng.uniform(-5.0, 5.0, 3)
    scale = (size * rng.uniform(0.5, 2.0, 3)).tolist()
    steps = f"{{scale: {scale}}}, {{rotate: {{axis: {axis.tolist()}, degrees: 53.7}}}}"
    return f"transform: [{steps}, {{translate: {move.tolist()}}}]", move


@pytest.mark.cases(2)
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("name", SHAPES)
def test_points_on_surfaces_are_seen(name: str, size: float) -> None:
    """From wherever a point just before them is, though rounding puts the point itself on one side
    of the surface or the other.

    Not tested: rays within two degrees of the surface, along which its error is larger.
    """
    rng = np.random.default_rng(len(name))
    turn, middle = turned(rng, size)
    tables = Scene.parse(ON_IT.format(shape=SHAPES[name].replace("TURN", turn))).tables
    starts = middle + 20.0 * size * rng.normal(size=(40, 3))
    ways = middle + 0.5 * size * rng.normal(size=(40, 3)) - starts
    hits = query.intersect(tables, starts, ways)
    tested = 0
    for k in np.flatnonzero(hits.shape == 0)[:5]:
        p = hits.p[k]
        o = p + 30.0 * size * rng.normal(size=(1000, 3))
        w = p - o
        cosine = np.abs(w @ hits.n[k]) / np.linalg.norm(w, axis=1)
        free = (cosine > 0.04) & ~query.occluded(tables, o, w, 1.0 - 1e-4)
        rays = [segment_to(SurfacePoint(Vec3(*q), UP, UP, 0.0, 0, -1), Vec3(*p)) for q in o[free]]
        ends = {ray.t_max for ray in rays}
        assert max(ends) < 1.0
        hidden = [query.occluded(tables, ray.o, ray.d, ray.t_max) for ray in rays]
        assert not np.any(hidden)
        tested += len(rays)
    assert tested > 200


CEILING = """
camera: {{type: perspective, eye: {eye}, target: {target}, up: [0.2, 0.9, 0.1], fov: 60}}
film: {{width: 24, height: 24}}
sampler: {{type: independent, spp: 1}}
integrator: {{type: {integrator}}}
shapes:
  - {{type: rectangle, transform: [{{scale: 4}}, {turn}]}}
  - {{type: rectangle, transform: [{{scale: 4}}, {{translate: [0, 0, 2]}}, {turn}]}}
lights: [{{type: {light}: {lamp}, intensity: 1}}]
"""


@pytest.mark.parametrize("integrator", ["whitted", "direct", "path"])
@pytest.mark.parametrize("light", ["point, position", "spot, cutoff_angle: 80, target: {}, origin"])
def test_a_lamp_on_a_ceiling(integrator: str, light: str) -> None:
    """Of a turned room: no pixel of the floor is dark."""
    turn = rotate((0.3, -0.5, 0.8), 77.7)[:, :3]
    places = [[0.0, 0.0, 1.5], [0.1, 0.0, 0.0], [0.1, 0.2, 2.0]]
    eye, target, lamp = ((turn @ np.array(place)).tolist() for place in places)
    scene = Scene.parse(
        CEILING.format(
            eye=eye,
            target=target,
            lamp=lamp,
            light=light.format(target),
            integrator=integrator,
            turn="{rotate: {axis: [0.3, -0.5, 0.8], degrees: 77.7}}",
        )
    )
    assert (render(scene).colour > 0.0).all()

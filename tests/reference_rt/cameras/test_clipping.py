"""Clipping planes: rays that end there, and pictures of what lies between them, by every camera and
integrator."""

import math

import numpy as np
import pytest
from builders import U
from camera_checks import CAMERAS, LENSES, POINTS

import reference_rt as rt
from reference_rt.cameras import camera_ray
from reference_rt.integrators import Direct, Path, RayCast, Whitted
from reference_rt.util.errors import SceneError


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_rays_go_from_the_near_to_the_far_clipping_plane(camera):
    """Along the lines of the same camera without planes."""
    near, far = 0.75, 12.5
    plain = camera.setup(8, 6)
    view = camera.model_copy(update={"near": near, "far": far}).setup(8, 6)
    eye, forward = np.array(camera.eye), -camera.basis[2]
    for lens in LENSES:
        for x, y in POINTS:
            ray, line = camera_ray(view, x, y, lens), camera_ray(plain, x, y, lens)
            start, end = np.array(ray.o), np.array(ray.o) + ray.t_max * np.array(ray.d)
            assert ray.d == line.d
            # A depth has the rounding of coordinates up to 20.
            assert (start - eye) @ forward == pytest.approx(near, abs=20 * 8 * U)
            assert (end - eye) @ forward == pytest.approx(far, abs=20 * 8 * U)
            along = start - np.array(line.o)
            assert np.abs(np.cross(along, ray.d)).max() < 20 * 8 * U
    without_end = camera.model_copy(update={"near": near}).setup(8, 6)
    assert camera_ray(without_end, 0.2, 0.3, LENSES[1]).t_max == math.inf


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_planes_in_another_order_are_refused(camera):
    with pytest.raises(SceneError, match="expected 'near' before 'far'"):
        type(camera).model_validate(camera.model_dump() | {"near": 2.0, "far": 2.0})
    with pytest.raises(SceneError):
        type(camera).model_validate(camera.model_dump() | {"near": -1.0})


LAYERS = ("albedo", "normal", "position", "depth", "id", "variance")

INTEGRATORS = {
    "ray_cast": RayCast(show="distance"),
    "whitted": Whitted(),
    "direct": Direct(),
    "path": Path(),
}


def seen(camera, integrator, depths):
    """Layers of a picture of black lamps at these depths, before a sky: those from depth 5 on are
    large, and right of the axis of view."""
    eye, (right, _, backward) = np.array(camera.eye), camera.basis
    aside = [1.2 if depth > 5.0 else 0.0 for depth in depths]
    centers = [eye - z * backward + x * right for z, x in zip(depths, aside, strict=True)]
    scene = rt.Scene(
        camera=camera,
        film=rt.Film(width=9, height=7, layers=() if isinstance(integrator, RayCast) else LAYERS),
        sampler=rt.Grid(spp=4) if isinstance(integrator, Whitted) else rt.Independent(spp=4),
        integrator=integrator,
        materials={
            f"lamp{k}": rt.Emissive(radiance=(depth, 1.0, 2.0)) for k, depth in enumerate(depths)
        },
        shapes=tuple(
            rt.Sphere(center=tuple(center), radius=max(0.3, aside[k]), material=f"lamp{k}")
            for k, center in enumerate(centers)
        ),
        lights=(rt.Constant(radiance=(1.0, 0.5, 0.25)),),
    )
    return rt.render(scene).layers


@pytest.mark.cases(12)
@pytest.mark.parametrize("integrator", INTEGRATORS.values(), ids=INTEGRATORS)
@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_only_what_lies_between_the_planes_is_seen(camera, integrator):
    """All layers are those of the scene without the lamps in front of them and behind."""
    clipped = camera.model_copy(update={"near": 2.0, "far": 5.0})
    found = seen(clipped, integrator, (3.0, 1.5, 6.5))
    alone = seen(clipped, integrator, (3.0,))
    for name, layer in found.items():
        assert np.array_equal(layer, alone[name]), name
    only_near = camera.model_copy(update={"near": 2.0})
    for other in (camera, only_near, camera.model_copy(update={"far": 5.0})):
        whole = seen(other, integrator, (3.0, 1.5, 6.5))
        assert not np.array_equal(found["colour"], whole["colour"])
    nearest = found["distance" if isinstance(integrator, RayCast) else "depth"].min()
    assert 0.69 < nearest < 1.4  # from the near plane to the lamp: 0.7, or nearly


def test_a_surface_that_reaches_across_a_plane_is_cut():
    """A rectangle seen at a slant: rows of the picture by similar triangles."""
    floor = rt.Rectangle(transform=({"rotate": {"axis": (1, 0, 0), "degrees": -90}}, {"scale": 50}))
    camera = rt.Perspective(eye=(0, 1, 0), target=(0, 1, -1), view=(-1, 1, -1, 1), near=2, far=4)
    scene = rt.Scene(
        camera=camera,
        film=rt.Film(width=4, height=200),
        integrator=RayCast(show="distance"),
        shapes=(floor,),
    )
    rows = np.flatnonzero(np.isfinite(rt.render(scene).layers["distance"][:, 0]))
    # The floor at depth z is seen 1 / z below the middle: from 1/4 to 1/2.
    assert rows.tolist() == list(range(125, 150))


def test_light_is_not_cut():
    """A floor between the planes reflects a sky and a lamp behind them."""
    steps = ({"rotate": {"axis": (1, 0, 0), "degrees": -90}}, {"scale": 50})
    scene = rt.Scene(
        camera=rt.Perspective(eye=(0, 1, 0), target=(0, 0, -1), fov=20),
        film=rt.Film(width=6, height=6),
        sampler=rt.Independent(spp=16, seed=1),
        shapes=(rt.Rectangle(transform=steps),),
        lights=(rt.Constant(radiance=0.5), rt.Point(position=(0, 30, 20), intensity=900.0)),
    )
    camera = scene.camera.model_copy(update={"near": 0.5, "far": 3.0})
    clipped = rt.render(scene.changed(camera=camera)).colour
    # Rays begin elsewhere on their lines, so that hits are rounded otherwise.
    assert clipped == pytest.approx(rt.render(scene).colour, rel=1e-9)

"""Light tracing: where particles come from, where cameras see them, and that their pictures are
those of the path tracer."""

import math
from typing import Any

import numpy as np
import pytest
from scipy import stats

import reference_rt as rt
from reference_rt.cameras import camera_ray, see
from reference_rt.cameras.film import AnyFilter
from reference_rt.cameras.filter_values import filter_reach, filter_value
from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import types_of
from reference_rt.core.ray import at
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import entry_kernel
from reference_rt.jit.links import Linker
from reference_rt.lights.emission import Emission, emit
from reference_rt.rendering.kernels import plain_arguments
from reference_rt.rendering.ray_tree import ray_trees
from reference_rt.rendering.render import Session, Storage
from reference_rt.scene.build_lights import emission_of
from reference_rt.scene.examples import examples
from reference_rt.util.errors import SceneError

# ---- cameras and filters -------------------------------------------------------------------------

_PLACE = {"eye": (1.0, 2.0, 5.0), "target": (0.2, 0.1, -0.3), "near": 0.5, "far": 9.0}
CAMERAS = (
    rt.Perspective(**_PLACE, fov=50.0),
    rt.Perspective(**_PLACE, view=(-1.0, 2.0, -0.5, 1.0), distance=2.0),
    rt.Pinhole(**_PLACE, film_width=2.0, film_distance=1.5),
    rt.Pinhole(**_PLACE, film_width=2.0, film_distance=1.5, hole_radius=0.05),
    rt.Orthographic(**_PLACE, view=(-1.0, 2.0, -0.5, 1.0)),
    rt.ThinLens(**_PLACE, aperture_radius=0.3, focus_distance=4.0),
)


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: camera.type)
def test_a_camera_sees_a_point_where_its_ray_meets_it(camera: Any) -> None:
    """`see` is the inverse of `camera_ray`, for the same lens point, and its weight is the Jacobian
    of that: by central differences of steps across the ray, whose error is of their third power."""
    view, step = camera.setup(40, 30), 1e-4
    for x, y, lens, share in ((0.2, 0.7, (0.3, 0.9), 0.4), (0.9, 0.1, (0.8, 0.2), 0.7)):
        ray = camera_ray(view, x, y, lens)
        p = at(ray, share * ray.t_max)
        seen = see(view, p, lens)
        assert np.allclose((seen.x, seen.y), (x, y), rtol=0.0, atol=1e-13)
        assert np.allclose(seen.d, ray.d, rtol=0.0, atol=1e-14)
        assert np.allclose(seen.o, ray.o, rtol=0.0, atol=1e-14)
        across = np.linalg.svd(np.array([ray.d]))[2][1:]
        moved = [
            [see(view, Vec3(*(np.array(p) + sign * step * axis)), lens) for sign in (-1.0, 1.0)]
            for axis in across
        ]
        changes = [[b.x - a.x, b.y - a.y] for a, b in moved]
        jacobian = abs(np.linalg.det(np.array(changes))) / (2.0 * step) ** 2
        assert seen.weight == pytest.approx(jacobian, rel=1e-6)
        for t in (-0.01, ray.t_max + 0.01):  # beyond the clipping planes
            assert see(view, at(ray, t), lens).weight == 0.0


@pytest.mark.parametrize("of", types_of(AnyFilter), ids=lambda of: of.__name__)
def test_a_filter_has_the_values_that_its_samples_are_drawn_by(of: Any) -> None:
    for one in examples(of):
        setup = one.setup()
        reach = filter_reach(setup)
        x = np.linspace(-1.1 * reach, 1.1 * reach, 1001)
        x = x[np.abs(np.abs(x) - reach) > 1e-9]
        values = [filter_value(setup, float(at)) for at in x]
        assert np.allclose(values, [one.value(float(at)) for at in x], rtol=0.0, atol=1e-12)


# ---- what the lamps send -------------------------------------------------------------------------


@entry_kernel
def _emit_all(scene: Any, emission: Emission, u: FloatArray, out: FloatArray) -> None:
    for k in range(len(u)):
        sent = emit(
            scene.lights,
            emission,
            scene.shapes,
            scene.textures,
            u[k, 0],
            (u[k, 1], u[k, 2]),
            (u[k, 3], u[k, 4]),
        )
        out[k, 0], out[k, 1], out[k, 2] = sent.power
        out[k, 3], out[k, 4], out[k, 5] = sent.ray.o
        out[k, 6], out[k, 7], out[k, 8] = sent.ray.d


def _sent(n: int, **parts: Any) -> FloatArray:
    from reference_rt.rendering.linking import calls_of, linked_scene

    scene = rt.Scene(integrator=rt.Light(), **parts)
    tables = scene.tables
    linker = Linker(is_plain=True)
    plain = linked_scene(linker, tables, calls_of(_emit_all))
    emission = emission_of(scene, tables.geometry, tables.lights)
    out = np.zeros((n, 9))
    u = np.random.default_rng(3).random((n, 5))
    _emit_all.py_func(plain, emission, u, out)
    return out


_AXIS = {"origin": (0.0, 4.0, 0.5), "target": (0.0, 0.0, 0.0)}
_BALL = (rt.Sphere(center=(0.3, 0.0, 0.0), radius=0.5),)
_TURNED = ({"scale": (0.5, 0.7, 0.3)}, {"rotate": {"axis": (1.0, 2.0, 3.0), "degrees": 40.0}})
_CUTOFF = math.radians(30.0)
_TABLE = {"vertical_angles": (0.0, 90.0), "values": ((4.0, 1.0),)}

LAMPS = {
    "point": ({"lights": (rt.Point(position=(1.0, 2.0, 3.0), intensity=2.0),)}, 8.0 * math.pi),
    "spot": (
        {"lights": (rt.Spot(**_AXIS, intensity=3.0, cutoff_angle=30.0, beam_width=30.0),)},
        6.0 * math.pi * (1.0 - math.cos(_CUTOFF)),
    ),
    "goniometric": (
        {"lights": (rt.Goniometric(**_AXIS, intensity=2.0, **_TABLE),)},
        # 4 less 3 gamma / (pi / 2), times sin gamma, whose primitives are known.
        2.0 * 2.0 * math.pi * (4.0 - 3.0 / (0.5 * math.pi)),
    ),
    "projector": (
        {"lights": (rt.Projector(**_AXIS, irradiance=2.0, fov=60.0, aspect=2.0),)},
        2.0 * 2.0 * math.tan(math.radians(30.0)) ** 2,
    ),
    "rectangle": ({"shapes": (rt.Rectangle(transform=_TURNED),)}, 2.0 * math.pi * 4.0 * 0.35),
    "disk": ({"shapes": (rt.Disk(transform=({"scale": 0.7},)),)}, 2.0 * math.pi * math.pi * 0.49),
    "sphere": ({"shapes": (rt.Sphere(radius=0.7),)}, 2.0 * math.pi * 4.0 * math.pi * 0.49),
    "box": (
        {"shapes": (rt.Box(transform=_TURNED),)},
        2.0 * math.pi * 8.0 * (0.35 + 0.15 + 0.21),
    ),
    "triangle": (
        {"shapes": (rt.Triangle(v0=(0.0, 0.0, 0.0), v1=(2.0, 0.0, 0.0), v2=(0.0, 1.0, 0.0)),)},
        2.0 * math.pi,
    ),
}


@pytest.mark.parametrize("name", LAMPS)
def test_particles_have_the_power_of_their_lamp(name: str) -> None:
    """Closed forms of the power, in all 1 / (pdf * ...) of 2000 particles: within five standard
    errors, which are below 2 %."""
    parts, power = LAMPS[name]
    if "shapes" in parts:
        lamp = {"lamp": rt.Emissive(radiance=2.0)}
        shapes = tuple(s.model_copy(update={"material": "lamp"}) for s in parts["shapes"])
        parts = {"materials": lamp, "shapes": shapes}
    found = _sent(2000, **parts)[:, 0]
    error = found.std(ddof=1) / math.sqrt(len(found))
    assert error < 0.03 * power
    assert abs(found.mean() - power) <= 5.0 * error + 1e-9 * power


@pytest.mark.parametrize(
    "light",
    [
        rt.Directional(direction=(1.0, -2.0, 0.5), irradiance=3.0),
        rt.Constant(radiance=2.0),
    ],
    ids=lambda light: light.type,
)
def test_light_from_far_away_fills_the_sphere_around_the_scene(light: Any) -> None:
    """Their power is that through the sphere's disk, and the rays meet the sphere evenly: the mean
    squared distance of lines from its centre is R² / 2."""
    found = _sent(2000, lights=(light,), shapes=_BALL)
    radius = math.sqrt(3.0) * 0.5  # of the sphere around the ball's box
    density = 3.0 if light.type == "directional" else 2.0 * 4.0 * math.pi
    # The sphere is enlarged by 1e-6, for rounding.
    assert np.allclose(found[:, 0], density * math.pi * radius**2, rtol=3e-6)
    w = found[:, 3:6] - (0.3, 0.0, 0.0)
    along = (w * found[:, 6:]).sum(axis=1)
    assert (along < 0.0).all()
    distance2 = (w * w).sum(axis=1) - along**2
    assert abs(distance2.mean() / radius**2 - 0.5) < 5.0 * math.sqrt(1.0 / 12.0 / 2000)


# ---- pictures ------------------------------------------------------------------------------------

_GREY = rt.Diffuse(reflectance=(0.7, 0.5, 0.3))
_FLOOR = rt.Rectangle(
    material="grey", transform=({"scale": 2.0}, {"rotate": {"axis": (1, 0, 0), "degrees": -90}})
)
_CEILING = ({"scale": 0.5}, {"rotate": {"axis": (1, 0, 0), "degrees": 90}})
_RAISED = {"translate": (0.2, 1.5, 0.0)}


def _scene(sample: Any = _GREY, **parts: Any) -> Any:
    """A ball of a material over a floor under a lamp."""
    raised = (*_CEILING, {"translate": (0.2, 2.0, 0.0)})
    return rt.Scene(
        **{
            "camera": rt.Perspective(eye=(0.0, 1.5, 4.0), target=(0.0, 0.4, 0.0), fov=40.0),
            "film": rt.Film(width=8, height=6),
            "sampler": rt.Sobol(spp=1024),
            "integrator": rt.Light(max_depth=4),
            "materials": {
                "grey": _GREY,
                "sample": sample,
                "lamp": rt.Emissive(radiance=(8.0, 9.0, 10.0), base="grey"),
            },
            "shapes": (
                _FLOOR,
                rt.Sphere(material="sample", center=(0.0, 0.6, 0.0), radius=0.5),
                rt.Rectangle(material="lamp", transform=raised),
            ),
            **parts,
        }
    )


RUNS = 24

FALSE_ALARMS = 1e-6
"""Of one test, if its means are normal: they are of some thousand samples each."""

TOLD = 0.1
"""Relative errors of a mean that every test here must see: a cosine, a density, an index of
refraction or a lobe's probability that is forgotten changes it by more (a cosine by a third)."""


def _means(scene: Any, integrator: Any, spp: int, **settings: Any) -> FloatArray:
    """Means (RUNS, 6) of the halves of pictures with other seeds, in each channel."""
    other = scene.changed(integrator=integrator)
    found = []
    for seed in range(RUNS):
        colour = rt.render(other, seed=seed, spp=spp, **settings).layers["colour"]
        half = colour.shape[1] // 2
        found.append([*colour[:, :half].mean((0, 1)), *colour[:, half:].mean((0, 1))])
    return np.array(found)


def _agree(scene: Any, depth: int = 4, light: Any = None, spp: int = 512) -> None:
    """Both integrators' means agree (Welch's test of each, with the fewest degrees of freedom that
    it can have)."""
    one = _means(scene, light or rt.Light(max_depth=depth), spp)
    two = _means(scene, rt.Path(max_depth=depth), spp // 2)
    error = np.sqrt((one.var(0, ddof=1) + two.var(0, ddof=1)) / RUNS)
    reach = stats.t.isf(0.5 * FALSE_ALARMS / one.shape[1], RUNS - 1) * error
    assert (reach <= TOLD * two.mean(0)).all(), "too noisy to tell"
    assert (np.abs(one.mean(0) - two.mean(0)) <= reach).all()


BALLS = {
    "diffuse": _GREY,
    "glass": rt.Dielectric(interior_ior=1.5),
    "rough glass": rt.RoughDielectric(interior_ior=1.5, alpha=0.3),
    "plastic": rt.Plastic(reflectance=0.5),
    "rough plastic": rt.RoughPlastic(reflectance=0.5, alpha=0.2),
    "metal": rt.RoughConductor(eta=0.2, k=3.0, alpha=(0.2, 0.5)),
    "mirror": rt.Mirror(reflectance=0.9),
    "pane": rt.ThinDielectric(interior_ior=1.5),
}


OFTEN = ("diffuse", "glass", "rough glass", "plastic", "mirror")


@pytest.mark.parametrize(
    "name",
    [name if name in OFTEN else pytest.param(name, marks=pytest.mark.slow) for name in BALLS],
)
def test_the_picture_is_that_of_the_path_tracer(name: str) -> None:
    _agree(_scene(BALLS[name]))


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: camera.type)
def test_every_camera_sees_it(camera: Any) -> None:
    _agree(_scene(camera=camera.model_copy(update={"near": 0.0, "far": None})), 3, spp=1024)


def test_a_film_with_an_exposure_sees_it() -> None:
    place = {"eye": (0.0, 1.5, 4.0), "target": (0.0, 0.4, 0.0), "film_width": 1.2}
    _agree(_scene(camera=rt.Pinhole(**place, hole_radius=0.05, exposure=40.0)), 3)


def test_a_filter_with_negative_lobes_spreads_it() -> None:
    _agree(_scene(film=rt.Film(width=8, height=6, filter=rt.LanczosFilter())), 2, spp=1024)


def test_clipped_surfaces_are_not_seen_and_hide_nothing() -> None:
    camera = rt.Perspective(eye=(0.0, 1.5, 4.0), target=(0.0, 0.4, 0.0), near=3.9, far=5.0)
    _agree(_scene(camera=camera), 3)


@pytest.mark.slow  # whose values are tested above
@pytest.mark.parametrize("of", types_of(AnyFilter), ids=lambda of: of.__name__)
def test_every_filter_spreads_it(of: Any) -> None:
    film = rt.Film(width=8, height=6, filter=of())
    _agree(_scene(film=film), 2, spp=1024)  # negative lobes add noise


LIGHTS = {
    "point": (rt.Point(position=(1.0, 2.5, 1.0), intensity=9.0),),
    "spot": (rt.Spot(**_AXIS, intensity=30.0, cutoff_angle=25.0),),
    "goniometric": (
        rt.Goniometric(
            **_AXIS,
            intensity=5.0,
            vertical_angles=(0.0, 20.0, 50.0),
            horizontal_angles=(90.0, 180.0, 270.0),
            values=((4.0, 3.0, 0.0), (4.0, 1.0, 0.0), (4.0, 5.0, 1.0)),
        ),
    ),
    "projector": (rt.Projector(**_AXIS, irradiance=20.0, fov=40.0),),
    "sun": (rt.Directional(direction=(1.0, -2.0, -1.0), irradiance=2.0),),
    "sky": (rt.Constant(radiance=(0.3, 0.4, 0.5)),),
    "many": (
        rt.Constant(radiance=0.2),
        *(rt.Point(position=(0.3 * k, 2.0, 1.0), intensity=1.0 + k) for k in range(10)),
    ),
}


@pytest.mark.parametrize(
    ("name", "hierarchy"), [*((name, "none") for name in LIGHTS), ("sun", "sah"), ("sky", "sah")]
)
def test_every_lamp_lights_it(name: str, hierarchy: str) -> None:
    """With a hierarchy, its root bounds what light from far away must meet."""
    _agree(_scene(lights=LIGHTS[name], hierarchy=hierarchy, shapes=_scene().shapes[:2]), 3)


def test_interpolated_normals_and_bumps() -> None:
    """Shading normals are not those of the surface: the factors of their cosines count."""
    mesh = rt.Mesh(
        vertices=np.array([[-1.5, 0.3, 1.0], [1.5, 0.3, 1.0], [1.5, 0.3, -1.5], [-1.5, 0.3, -1.5]]),
        faces=np.array([[0, 1, 2], [0, 2, 3]]),
        normals=np.array([[0.6, 0.8, 0], [-0.6, 0.8, 0], [0, 0.8, 0.6], [0, 0.8, -0.6]]),
        material="sample",
    )
    _agree(_scene(_GREY, shapes=(mesh, *_scene().shapes[2:])))
    shapes = (mesh, *_scene().shapes[2:], _scene().shapes[1])
    large = rt.Rectangle(material="lamp", transform=({"scale": 3.0}, _CEILING[1], _RAISED))
    _agree(_scene(BALLS["mirror"], shapes=(*shapes[:1], large, shapes[2])), spp=2048)


def test_roulette_does_not_change_the_mean() -> None:
    _agree(_scene(), 5, rt.Light(max_depth=5, rr_depth=1))


def test_edges_are_counted_as_by_the_path_tracer() -> None:
    """With one edge nothing but lamps and the sky is seen, with the bits of the path tracer; with
    none, nothing."""
    scene = _scene(BALLS["glass"], lights=LIGHTS["sky"])
    for depth in (0, 1):
        one, two = (
            rt.render(scene.changed(integrator=of(max_depth=depth)), spp=16).layers["colour"]
            for of in (rt.Light, rt.Path)
        )
        assert np.array_equal(one, two)
        assert (depth == 1) == bool(one.any())


def test_the_number_of_threads_changes_no_bit() -> None:
    scene = _scene(BALLS["plastic"])
    pictures = [rt.render(scene, spp=48, threads=n).layers["colour"] for n in (1, 2, 5)]
    assert np.array_equal(pictures[0], pictures[1])
    assert np.array_equal(pictures[0], pictures[2])


def test_caustics_of_points_are_there_unless_left_out() -> None:
    """Behind a pane in front of a point no path from the camera finds the lamp: what is left
    without caustics is what paths find."""
    pane = rt.Rectangle(material="sample", transform=({"scale": 0.6}, *_CEILING[1:], _RAISED))
    lamp = (rt.Point(position=(0.2, 2.5, 0.0), intensity=9.0),)
    scene = _scene(BALLS["pane"], lights=lamp, shapes=(_FLOOR, pane))
    _agree(scene, 4, rt.Light(max_depth=4, caustics_of_points=False))
    whole, left = (
        _means(scene, rt.Light(max_depth=4, caustics_of_points=caustics), 256).mean(axis=0)
        for caustics in (True, False)
    )
    assert (whole > 1.2 * left).all()


# ---- what it refuses -----------------------------------------------------------------------------


def test_lamps_and_scenes_that_it_cannot_light_are_refused() -> None:
    plane = rt.Plane(material="grey")
    with pytest.raises(SceneError, match="has no end"):
        rt.render(_scene(shapes=(plane,), lights=LIGHTS["sun"]))
    rt.render(_scene(shapes=(plane,), lights=LIGHTS["point"]), spp=1)
    with pytest.raises(SceneError, match="cannot draw points"):
        rt.render(_scene(shapes=(rt.Torus(material="lamp"),)))
    with pytest.raises(SceneError, match="no variance"):
        rt.render(_scene(film=rt.Film(width=8, height=6, layers=("variance",))))


def test_what_needs_samples_of_a_pixel_is_refused(tmp_path: Any) -> None:
    scene = _scene()
    with pytest.raises(SceneError, match="one process"):
        Session(scene, storage=Storage(tmp_path))
    with pytest.raises(SceneError, match="no mean of samples"):
        ray_trees(scene, [(0, 0, 0)])
    with pytest.raises(ValueError, match="no radiance of a ray"):
        scene.radiance(np.zeros((1, 3)), np.ones((1, 3)))


def test_other_integrators_neither_compile_nor_call_it() -> None:
    from reference_rt.rendering.accumulation import jobs_of

    scene = _scene().changed(integrator=rt.Path())
    (job,) = jobs_of(scene)
    film = scene.film
    view = scene.camera.setup(film.width, film.height)
    assert "splat" not in job.kernel.__name__
    assert plain_arguments(job, scene.tables, view, film.filter.setup())

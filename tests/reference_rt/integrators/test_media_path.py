"""Paths through media, against what is known without tracing any."""

import numpy as np
import pytest
from builders import SCENES, placed, same_in_plain_python, unit_vectors
from worlds import assert_mean

import reference_rt as rt
from reference_rt.core.exr import write_exr

SKY = rt.Constant(radiance=1.0)
INK = rt.Homogeneous(sigma_t=(0.3, 0.7, 2.0), albedo=0.0)
EDGE = {"edge": rt.NoSurface()}


def cube(half):
    """A closed mesh, its normals outwards."""
    corners = half * np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1], indexing="ij")).reshape(3, 8).T
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))]
    return rt.Mesh(vertices=corners, faces=np.array(triangles))


CLOSED = {
    "sphere": rt.Sphere(radius=0.9),
    "box": rt.Box(),
    "cylinder": rt.Cylinder(capped=True),
    "cone": rt.Cone(capped=True),
    "torus": rt.Torus(),
    "mesh": cube(0.8),
    "ring": rt.Difference(
        of=(rt.Sphere(), rt.Cylinder(radius=0.4, transform=({"scale": (1, 1, 3)},)))
    ),
    "lens": rt.Intersection(of=(rt.Sphere(center=(-0.3, 0, 0)), rt.Sphere(center=(0.3, 0, 0)))),
    "pair": rt.Union(of=(rt.Sphere(), rt.Box(transform=({"translate": (0.6, 0, 0)},)))),
}
"""One of each type that encloses space."""


def at(x, z=0.0):
    return rt.transform.Translate(translate=(x, 0.0, z))


def filled(shape, k, *steps):
    """A shape, moved, with a boundary that is no surface, filled with ink number k."""
    changes = {"transform": steps, "material": "edge", "interior": f"ink {k}"}
    return shape.model_copy(update=changes)


def inks(n):
    """Media that only absorb, each in another way."""
    return {
        f"ink {k}": rt.Homogeneous(sigma_t=(0.05 + 0.1 * k, 0.3, 1.0 / (1 + k)), albedo=0.0)
        for k in range(n)
    }


def optical_depth(scene, o, d):
    """Of each ray, in each colour, through shapes filled with the media of their numbers: from the
    crossings with each shape."""
    found, n = scene.crossings(o, d), len(scene.shapes)
    sigma_t = np.array([medium.sigma_t for medium in scene.media.values()])
    depth = np.zeros((len(o), 3))
    for k in range(n):
        of = found.shape == k
        ray, t = found.ray[of], found.t[of]
        assert (ray[::2] == ray[1::2]).all()
        np.add.at(depth, ray[::2], (t[1::2] - t[::2])[:, None] * sigma_t[k])
    return depth


@pytest.mark.parametrize("way", ["none", "sah", "copies"])
@pytest.mark.parametrize("mirrored", [False, True])
def test_absorption_in_every_closed_shape(way, mirrored):
    """Beer and Lambert's law, without noise, along the crossings of each ray: of shapes themselves,
    and of instances of groups that have one each."""
    rng = np.random.default_rng(11)
    shapes, groups, centres = [], {}, 9.0 * np.arange(len(CLOSED))
    for k, shape in enumerate(CLOSED.values()):
        flip = rt.transform.Scale(scale=(-1.0 if mirrored else 1.0, 1.0, 1.0))
        steps = (flip, *placed(rng, 1.2, 0.2), at(float(centres[k])))
        if way == "copies":
            groups[f"group {k}"] = (filled(shape, k),)
            shapes.append(rt.Instance(group=f"group {k}", transform=steps))
        else:
            shapes.append(filled(shape, k, *steps))
    scene = rt.Scene(
        materials=EDGE,
        media=inks(len(shapes)),
        shapes=tuple(shapes),
        groups=groups,
        lights=(SKY,),
        hierarchy="auto" if way == "copies" else way,
    )
    targets = np.repeat(centres, 40)[:, None] * [1.0, 0.0, 0.0] + 0.5 * rng.normal(size=(360, 3))
    o = targets + 60.0 * unit_vectors(rng, len(targets))
    d = (targets - o) / np.linalg.norm(targets - o, axis=1, keepdims=True)
    depth = optical_depth(scene, o, d)
    assert (depth.any(axis=1).reshape(9, 40).sum(axis=1) >= 10).all()  # each is met
    # A boundary moves by the error bound of its point, some 2^-48 of the coordinates, over the
    # cosine at which the ray meets it, at each of at most some ten boundaries.
    found = scene.radiance(o, d, spp=1).mean
    np.testing.assert_allclose(found, np.exp(-depth), rtol=1e-11)


def test_shadow_rays_lose_what_rays_lose():
    """A lamp at a point lights a floor through media: by the crossings of each shadow ray."""
    rng = np.random.default_rng(3)
    names = ("sphere", "box", "torus", "ring")
    shapes = [
        filled(CLOSED[name], k, *placed(rng, 0.5, 0.3), at(2.0 * k - 3.0, 2.0))
        for k, name in enumerate(names)
    ]
    lamp = np.array([0.3, 0.2, 5.0])
    parts = {"materials": EDGE, "media": inks(len(names))}
    clouds = rt.Scene(shapes=tuple(shapes), **parts)
    floor = rt.Rectangle(transform=({"scale": 20.0},))
    lit = rt.Scene(
        shapes=(*shapes, floor),
        lights=(rt.Point(position=tuple(lamp), intensity=100.0),),
        integrator=rt.Path(max_depth=2),
        **parts,
    )
    p = np.concatenate([rng.uniform(-6.0, 6.0, (200, 2)), np.zeros((200, 1))], axis=1)
    down = np.tile([0.0, 0.0, -1.0], (200, 1))
    # The camera rays begin below all media, just above the floor.
    found = lit.radiance(p + np.array([0.0, 0.0, 1e-3]), down, spp=1).mean
    w = lamp - p
    distance = np.linalg.norm(w, axis=1, keepdims=True)
    depth = optical_depth(clouds, p, w / distance)
    expected = 0.5 / np.pi * 100.0 / distance**2 * (w[:, 2:] / distance) * np.exp(-depth)
    assert depth.any(axis=1).sum() > 20
    np.testing.assert_allclose(found, expected, rtol=1e-11)


# ---- light that is scattered ---------------------------------------------------------------------

BALL = rt.Sphere(radius=1.0, material="edge", interior="fog")
PHASES = {
    "isotropic": rt.Isotropic(),
    "forward": rt.HenyeyGreenstein(g=0.7),
    "back": rt.HenyeyGreenstein(g=-0.6),
    "rayleigh": rt.Rayleigh(),
    "mixed": rt.BlendPhase(first=rt.HenyeyGreenstein(g=0.8), second=rt.Rayleigh(), weight=0.4),
}


def fog(sigma_t=(0.5, 1.0, 3.0), albedo=1.0, phase=PHASES["forward"], **more):
    return rt.Homogeneous(sigma_t=sigma_t, albedo=albedo, phase=phase, **more)


def seen(*shapes, media, lights=(SKY,), materials=EDGE, spp=64, camera=None, **parts):
    return rt.Scene(
        camera=camera or rt.Perspective(eye=(0.3, 0.5, 4.0), target=(0.0, 0.0, 0.0), fov=25),
        film=rt.Film(width=16, height=16, layers=("variance",)),
        sampler=rt.Independent(spp=spp, seed=5),
        shapes=shapes,
        media=media,
        lights=lights,
        materials=materials,
        **parts,
    )


GLASS = {"glass": rt.Dielectric(interior_ior=1.5)}
INDEX_MATCHED = {"glass": rt.Dielectric(interior_ior=1.0 + 1e-9)}
WHITE = {"white": rt.Diffuse(reflectance=1.0)}

FURNACES = {
    **{f"phase {name}": {"media": {"fog": fog(phase=of)}} for name, of in PHASES.items()},
    "lights alone": {"integrator": rt.Path(sampling="lights"), "media": {"fog": fog()}},
    "scattering alone": {"integrator": rt.Path(sampling="bsdf"), "media": {"fog": fog()}},
    "roulette at once": {"integrator": rt.Path(rr_depth=1), "media": {"fog": fog()}},
    "glass around it": {
        "shapes": (BALL.model_copy(update={"material": "glass"}),),
        "materials": GLASS,
    },
    "index matched": {
        "shapes": (BALL.model_copy(update={"material": "glass"}),),
        "materials": INDEX_MATCHED,
    },
    "seen from within": {
        "camera": rt.Perspective(eye=(0.2, 0, 0), target=(0, 0.1, -1), fov=80, medium="fog")
    },
    "a white ball in it": {
        "shapes": (BALL, rt.Sphere(radius=0.4, material="white")),
        "materials": EDGE | WHITE,
    },
    "another in it": {
        "shapes": (
            BALL,
            rt.Box(
                material="edge",
                interior="haze",
                exterior="fog",
                transform=({"scale": 0.4}, {"rotate": {"axis": (1, 2, 3), "degrees": 30}}),
            ),
        ),
        "media": {"fog": fog(), "haze": fog((2.0, 0.1, 0.0), phase=PHASES["back"])},
    },
    "copies": {
        "shapes": (
            rt.Instance(group="clouds", transform=({"scale": (0.6, 0.4, 0.5)},)),
            rt.Instance(group="clouds", transform=({"scale": -0.3}, {"translate": (0.8, 0.5, 1)})),
        ),
        "groups": {"clouds": (BALL,)},
    },
    "an environment map": {"lights": "map"},
}


@pytest.mark.parametrize("name", FURNACES)
def test_where_everything_shines_alike_nothing_is_seen(name, tmp_path):
    """Scattering without absorption under a sky of radiance 1."""
    parts = {"media": {"fog": fog()}} | FURNACES[name]
    if parts.get("lights") == "map":
        write_exr(tmp_path / "sky.exr", {c: np.ones((3, 4)) for c in "RGB"}, {})
        parts["lights"] = (rt.EnvironmentMap(file=str(tmp_path / "sky.exr")),)
    shapes = parts.pop("shapes", (BALL,))
    assert_mean(seen(*shapes, spp=256, **parts), 1.0, power=1.2e-2)


def test_no_colour_has_large_weights():
    """A third of the paths have a colour's own density, so that the second moment of its samples is
    at most three times that of paths which all have it (Veach 1997, 9.2: the balance heuristic)."""
    path = rt.Path(sampling="bsdf", rr_depth=4096)
    sigma_t, albedo = (0.02, 1.0, 8.0), (1.0, 0.99, 0.9)
    moments = []
    for medium in (
        fog(sigma_t, albedo, rt.Isotropic()),
        *(fog(s, a, rt.Isotropic()) for s, a in zip(sigma_t, albedo, strict=True)),
    ):
        picture = rt.render(seen(BALL, media={"fog": medium}, spp=256, integrator=path))
        moments.append(256.0 * picture.layers["variance"] + picture.colour**2)
        moments[-1] = moments[-1].sum(axis=(0, 1))
    for k in range(3):
        # A twentieth more: moments of 65,536 samples have a noise of some percent.
        assert moments[0][k] < 1.05 * 3.0 * moments[1 + k][0]


# ---- where a path without media goes -------------------------------------------------------------


def same_bits(scene):
    """Whether the kernel for media has the bits of that without, where there are none."""
    changed = scene.changed(materials={**scene.materials, "of no shape": rt.NoSurface()})
    assert changed.has_media
    assert not scene.has_media
    small = {"spp": 3, "size": (12, 9)}
    return (
        rt.render(scene, **small).colour.tobytes() == rt.render(changed, **small).colour.tobytes()
    )


@pytest.mark.parametrize("name", ["cornell_box", "caustic_glass", "many_lights"])
def test_without_media_the_picture_keeps_its_bits(name):
    assert same_bits(rt.Scene.load(SCENES / f"{name}.yaml"))


@pytest.mark.slow
def test_in_every_scene():
    scenes = [rt.Scene.load(path) for path in sorted(SCENES.glob("*.yaml"))]
    paths = [s for s in scenes if isinstance(s.integrator, rt.Path) and not s.has_media]
    assert len(paths) > 40
    assert [scene.name for scene in paths if not same_bits(scene)] == []


def test_boundaries_are_no_edges_of_a_path():
    """Three shells without a surface around a lamp and a floor change nothing, for any length."""
    shells = tuple(rt.Sphere(radius=r, material="edge") for r in (1.5, 2.0, 2.5))
    inner = (
        rt.Sphere(radius=0.3, center=(0, 0.9, 0), material="lamp"),
        rt.Rectangle(material="floor"),
    )
    materials = EDGE | {"lamp": rt.Emissive(radiance=3.0), "floor": rt.Diffuse(reflectance=0.6)}
    for depth in (1, 2, 3, None):
        path = rt.Path(max_depth=depth)
        scenes = [
            seen(*shapes, media={}, materials=materials, integrator=path, spp=4)
            for shapes in (inner, (*shells, *inner))
        ]
        plain, wrapped = (rt.render(scene).colour for scene in scenes)
        # Rays start again at each shell, which moves them by the error bound of its points.
        np.testing.assert_allclose(wrapped, plain, rtol=1e-9, atol=1e-9)


def test_hidden_lamps_are_passed_and_light_the_fog():
    """From a camera in vacuum and in fog: the lamp is not seen, its light is."""
    lamp = rt.Sphere(radius=0.3, material="lamp")
    materials = EDGE | {"lamp": rt.Emissive(radiance=5.0)}
    pictures = {}
    for hides in (False, True):
        path = rt.Path(hide_emitters=hides, max_depth=2)
        scene = seen(
            BALL,
            lamp,
            media={"fog": fog((0.2, 0.4, 0.6))},
            materials=materials,
            integrator=path,
            lights=(),
        )
        pictures[hides] = rt.render(scene).colour
    middle = np.s_[7:9, 7:9]
    assert (pictures[False][middle] > 2.0).all()
    assert (pictures[True][middle] < 1.5).all()
    assert (pictures[True][middle] > 0.01).all()
    # Beside the lamp both see the same light, by the same numbers.
    assert (pictures[False][0] == pictures[True][0]).all()


def test_plain_python_has_the_same_bits(tmp_path):
    same_in_plain_python(write_fog, tmp_path)


def write_fog(_folder, file):
    scene = seen(
        BALL,
        rt.Sphere(radius=0.2, material="lamp"),
        rt.Rectangle(transform=({"translate": (0, 0, -1.2)},)),
        media={"fog": fog(albedo=0.8, phase=PHASES["mixed"])},
        materials=EDGE | {"lamp": rt.Emissive(radiance=5.0)},
    )
    np.savez(file, colour=rt.render(scene, spp=2, size=(4, 3), threads=1).colour)


def test_a_derivative_by_the_medium():
    """Of exp(-2 sigma r) sky by sigma, by the scale and by the radius, at the middle of a ball."""
    camera = rt.Orthographic(eye=(0, 0, 4), target=(0, 0, 0), width=1e-6)
    ink = rt.Homogeneous(sigma_t=0.4, albedo=0.0, scale=1.5)
    scene = seen(BALL, media={"fog": ink}, camera=camera, spp=1).changed(
        film=rt.Film(width=1, height=1)
    )
    left = np.exp(-2.0 * 0.6)
    for path, expected in {
        "media.fog.sigma_t": -2.0 * 1.5 * left,
        "media.fog.scale": -2.0 * 0.4 * left,
        "shapes[0].radius": -2.0 * 0.6 * left,
    }.items():
        found = rt.derivative(scene, path)
        # Richardson's two steps leave a few 1e-7 of such a smooth function.
        np.testing.assert_allclose(found.picture, expected, rtol=1e-4)


def test_a_thin_medium_without_end():
    """A path may fly beyond what can be squared: no light comes from there, and no NaN."""
    haze = rt.Homogeneous(sigma_t=(1e-300, 1e-200, 1e-9), albedo=1.0)
    camera = rt.Perspective(eye=(0, 0, 4), target=(0, 0, 0), medium="haze")
    scene = seen(
        rt.Sphere(),
        media={"haze": haze},
        camera=camera,
        lights=(rt.Point(position=(3, 4, 5), intensity=50),),
    )
    colour = rt.render(scene).colour
    assert np.isfinite(colour).all()
    clear = rt.render(scene.changed(media={"haze": haze.model_copy(update={"scale": 0.0})})).colour
    # What scatters within the scene's 10 units is 1e-8 of the light.
    np.testing.assert_allclose(colour[8, 8], clear[8, 8], rtol=1e-5)

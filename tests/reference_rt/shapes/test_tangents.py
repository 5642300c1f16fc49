"""dp/du and dp/dv against differences of hit points, and where there are none."""

import math

import numpy as np
import pytest
from builders import U, unit_vectors
from drivers import meet
from hypothesis import given
from hypothesis import strategies as st

import reference_rt as rt
from reference_rt import shapes as any_shape
from reference_rt.accel import geometry
from reference_rt.core import transform
from reference_rt.core.ray import Hit, Ray
from reference_rt.core.vec3 import Vec3, frame_from_normal, normalize, row
from reference_rt.jit.kernel import entry_kernel
from reference_rt.materials.material import frame_along, oriented_frame
from reference_rt.shapes import TABLES
from reference_rt.shapes.meshes import triangle
from reference_rt.shapes.shape import Tangents

N = 60
STEP = 1e-5

QUADRICS = {
    "paraboloid": ((1, 0.5, 0, 0.2, 0, 0, 0.1, 0, -1, -0.5), False),
    "hyperboloid": ((1, 2, -1, 0, 0.3, 0, 0, 0.1, 0, -0.3), False),
    "saddle": ((1, -1, 0, 0, 0, 0, 0, 0, -1, 0.05), True),
}


def shapes_of(folder):
    """Every kind of shape, with all sides of its table's own: names and shapes."""
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0.5], [-1, 1, 0]], float)
    lines = [f"v {x} {y} {z}" for x, y, z in square]
    lines += ["vt 0.1 0.2", "vt 0.9 0.3", "vt 0.4 0.8", "vt -0.5 1.7"]
    lines += ["f 1/1 2/2 3/3", "f 1/3 3/1 4/4"]  # the second with uv that turn the other way
    (folder / "square.obj").write_text("\n".join(lines) + "\n")
    box = {"lower": (-1.0, -0.8, -0.7), "upper": (0.9, 1.0, 1.1)}
    return {
        "sphere": rt.Sphere(center=(0.1, 0.2, -0.1), radius=0.8),
        "rectangle": rt.Rectangle(),
        "box": rt.Box(),
        "triangle": rt.Triangle(v0=(-1, -1, 0), v1=(1, -0.5, 0), v2=(0.2, 1, 0.3)),
        "mesh": rt.Mesh(file=str(folder / "square.obj")),
        "disk": rt.Disk(),
        "plane": rt.Plane(),
        "polygon": rt.Polygon(rings=[[(-1, -1), (1, -0.5), (0.8, 1), (-0.9, 0.7)]]),
        "cylinder": rt.Cylinder(radius=0.7, z_min=-0.9),
        "cone": rt.Cone(radius=0.8, height=1.5, top_radius=0.2, capped=False),
        "torus": rt.Torus(major_radius=0.8, minor_radius=0.3),
        **{
            name: rt.Quadric(coefficients=k, capped=capped, **box)
            for name, (k, capped) in QUADRICS.items()
        },
    }


def somewhere(rng):
    """A map with shear, of condition below about 10, that mirrors as often as not."""
    while True:
        linear = rng.normal(size=(3, 3))
        if np.linalg.cond(linear) < 10.0:
            return (
                transform.Matrix(matrix=np.column_stack([linear, rng.normal(size=3)]).tolist()),
            )


def similarity(rng):
    """A map under which a sphere stays one, and which mirrors."""
    return (
        transform.Scale(scale=(-0.7, 0.7, 0.7)),
        transform.Rotate(rotate=transform.Turn(axis=tuple(unit_vectors(rng, 1)[0]), degrees=50.0)),
        transform.Translate(translate=(1.0, -2.0, 0.5)),
    )


@entry_kernel
def _alone(shapes, kind, i, o, d, out):
    """What primitive i alone shows to n rays."""
    for k in range(len(o)):
        ray = Ray(row(o, k), row(d, k), math.inf)
        hit = meet(shapes, kind, i, ray)
        out[k, 0] = -1.0
        if hit.kind >= 0:
            point = any_shape.surface(shapes, ray, hit)
            tangents = any_shape.tangents(shapes, ray, hit)
            u, v = any_shape.uv(shapes, ray, hit)
            _write(out[k], hit.t, any_shape.face(shapes, hit), point, u, v, tangents)


@entry_kernel
def _in_scene(scene, o, d, out):
    """What a scene's geometry shows to n rays."""
    for k in range(len(o)):
        ray = Ray(row(o, k), row(d, k), math.inf)
        hit = geometry.closest_hit(scene, ray)
        out[k, 0] = -1.0
        if hit.kind >= 0:
            point = geometry.surface(scene, ray, hit)
            tangents = geometry.tangents(scene, ray, hit)
            owner = geometry.owner(scene, hit)
            where = geometry.coordinates(scene, ray, hit)
            number = owner.face + 100 * owner.part + 10000 * owner.shape
            _write(out[k], hit.t, number, point, where.u, where.v, tangents)


@geometry.kernel
def _write(out, t, number, point, u, v, tangents):
    out[0], out[1], out[2], out[3] = t, number, u, v
    out[4], out[5], out[6] = point.p
    out[7], out[8], out[9] = point.n
    out[10], out[11], out[12] = tangents.dpdu
    out[13], out[14], out[15] = tangents.dpdv


def check(trace, o, d, least):
    """Around what each ray meets, points move as dp/du and dp/dv say: two directions of moving
    fix both.  trace(o, d) is what rays find; at least `least` of them must be compared."""

    def found(d):
        with np.errstate(all="ignore"):
            return trace(o, np.ascontiguousarray(d))

    middle = found(d)
    across = np.cross(d, np.array([0.3, -0.5, 0.8]))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    compared = 0
    for e in (across, np.cross(d, across)):
        one, two = found(d + STEP * e), found(d - STEP * e)
        change = one - two
        du, dv = change[:, 2:3], change[:, 3:4]
        dp = change[:, 4:7]
        # Next to a rim, a pole or a seam of u, and where rays graze, differences say little.
        good = middle[:, 0] > 0.0
        good &= (one[:, 0] > 0.0) & (two[:, 0] > 0.0)
        good &= (one[:, 1] == middle[:, 1]) & (two[:, 1] == middle[:, 1])
        good &= (np.abs(change[:, 2:4]) < 1e-3).all(axis=1)
        good &= np.linalg.norm(dp, axis=1) < 1e-3
        dpdu, dpdv = middle[:, 10:13], middle[:, 13:16]
        off = np.linalg.norm(dpdu * du + dpdv * dv - dp, axis=1)
        # Steps are symmetric: what is left is of their third order, relatively the square of 1e-3
        # times what curvature and grazing make of it.
        assert (off[good] <= 1e-4 * np.linalg.norm(dp[good], axis=1)).all()
        compared += good.sum()
        for tangent in (dpdu[good], dpdv[good]):
            n = middle[good, 7:10]
            cosine = np.sum(tangent * n, axis=1) / np.linalg.norm(tangent, axis=1)
            assert np.abs(cosine).max() < 1e-11  # roundings, times the condition of the map
    assert compared >= least


def rays(rng, target, reach):
    o = target + reach * unit_vectors(rng, N)
    aim = target + 0.6 * rng.normal(size=(N, 3))
    return o, aim - o


def test_every_shape(tmp_path):
    """Under maps that shear and mirror; the sphere too as the ellipsoid that it then is."""
    rng = np.random.default_rng(1)
    shapes = shapes_of(tmp_path)
    places = {name: somewhere(rng) for name in shapes} | {"sphere": similarity(rng)}
    placed = [s.model_copy(update={"transform": places[name]}) for name, s in shapes.items()]
    placed.append(shapes["sphere"].model_copy(update={"transform": somewhere(rng)}))
    tables = rt.build_tables(rt.Scene(shapes=tuple(placed))).geometry.shapes
    compared = set()
    for kind, field, _, _ in TABLES:
        table = getattr(tables, field)
        for i in range(len(table.owner)):

            def trace(o, d, kind=kind, i=i):
                out = np.zeros((len(o), 16))
                _alone(tables, kind, i, o, d, out)
                return out

            m = transform.affine(placed[table.owner[i]].transform)
            o, d = rays(rng, m[:, 3], 4.0)
            check(trace, o, d, N // 4)
            compared.add(int(table.owner[i]))
    assert compared == set(range(len(placed)))


@pytest.mark.slow
def test_in_instances_and_solids(tmp_path):
    """Through groups in groups, and of what a difference leaves, outside and in the cut."""
    rng = np.random.default_rng(2)
    shapes = shapes_of(tmp_path)
    ball = rt.Sphere(center=(0.6, 0.4, 0.8), radius=0.8)
    scene = rt.Scene(
        groups={
            "inner": (shapes["disk"], shapes["torus"]),
            "outer": (rt.Instance(group="inner", transform=somewhere(rng)),),
        },
        shapes=(
            rt.Instance(group="outer", transform=(transform.Translate(translate=(9.0, 0.0, 0.0)),)),
            rt.Box(transform=somewhere(rng)) - ball,
        ),
    )
    tables = rt.build_tables(scene)

    def trace(o, d):
        out = np.zeros((len(o), 16))
        _in_scene(tables.geometry, o, d, out)
        return out

    for target in ((9.0, 0.0, 0.0), (0.0, 0.0, 0.0)):
        o, d = rays(rng, np.array(target), 5.0)
        check(trace, o, d, N // 4)


NOWHERE = {
    "pole of a sphere": rt.Sphere(radius=0.5),
    "pole of an ellipsoid": rt.Sphere(transform=(transform.Scale(scale=(1.0, 2.0, 0.5)),)),
    "middle of a disk": rt.Disk(),
    "apex of a cone": rt.Cone(capped=False),
    "middle of a paraboloid": rt.Quadric(
        coefficients=(1, 1, 0, 0, 0, 0, 0, 0, 1, 0), lower=(-1, -1, -1), upper=(1, 1, 1)
    ),
    "level quadric": rt.Quadric(
        coefficients=(0, 0, 0, 0, 0, 0, 0, 0, 1, 0), lower=(-1, -1, -1), upper=(2, 1, 1)
    ),
}


@pytest.mark.parametrize("name", NOWHERE)
def test_where_there_are_none(name):
    """On axes, where u is not defined, and where v is the same all over: a unit basis."""
    shapes = rt.build_tables(rt.Scene(shapes=(NOWHERE[name],))).geometry.shapes
    (kind,) = (code for code, field, _, _ in TABLES if getattr(shapes, field) is not None)
    top = {"pole of a sphere": 0.5, "pole of an ellipsoid": 0.5, "apex of a cone": 1.0}
    ray = Ray(Vec3(0.0, 0.0, 2.0), Vec3(0.0, 0.0, -1.0), math.inf)
    hit = Hit(2.0 - top.get(name, 0.0), kind, 0, 0.0, 0.0, -1)
    np.testing.assert_array_equal(any_shape.surface(shapes, ray, hit).n, (0.0, 0.0, 1.0))
    tangents = np.array(any_shape.tangents(shapes, ray, hit))
    np.testing.assert_array_equal(np.abs(tangents), np.eye(3)[:2])


@pytest.mark.parametrize("uvs", [[0.5] * 6, [0, 0, 1, 1, 2, 2], [0, 0, 0.1, 0.7, 0.3, 2.1]])
def test_texture_coordinates_without_area(uvs):
    """Points and lines, one that rounding bends."""
    shape = rt.Triangle(v0=(0, 0, 0), v1=(3, 0, 0), v2=(0, 4, 5))
    tables = rt.build_tables(rt.Scene(shapes=(shape,))).geometry.shapes
    shapes = tables._replace(triangles=tables.triangles._replace(uvs=np.array([uvs], float)))
    ray = Ray(Vec3(0.5, 0.5, 9.0), Vec3(0.0, 0.0, -1.0), math.inf)
    hit = Hit(8.0, any_shape.TRIANGLE, 0, 0.2, 0.3, -1)
    basis = np.array([*any_shape.tangents(shapes, ray, hit), any_shape.surface(shapes, ray, hit).n])
    np.testing.assert_allclose(basis @ basis.T, np.eye(3), rtol=0, atol=8 * U)


def test_texture_coordinates_too_small():
    """dp/du would overflow: no coordinates either."""
    vertices = Vec3(1e200, 0.0, 0.0), Vec3(0.0, 1e200, 0.0), Vec3(0.0, 0.0, 1.0)
    tiny = np.array([[0.0, 0.0, 1e-150, 0.0, 0.0, 1e-150]])
    with np.errstate(over="ignore", invalid="ignore"):
        found = triangle._tangents_of_uv(tiny, 0, *vertices)
    np.testing.assert_array_equal(np.abs(found), np.eye(3)[:2])


DIRECTIONS = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(any)


@given(n=DIRECTIONS, dpdu=DIRECTIONS, power=st.integers(-1000, 1000), near=st.booleans())
def test_oriented_frame(n, dpdu, power, near):
    """Orthonormal to rounding, right-handed, of any length of dp/du; s in the half plane of dp/du;
    also where that is all but parallel to the normal."""
    n = Vec3(*(np.array(n) / max(map(abs, n))))
    n = normalize(n)
    size = max(map(abs, dpdu))
    d = Vec3(*(np.array(dpdu) / size))
    if near:
        d = n + d * 1e-13
    s, t, z = oriented_frame(n, Tangents(d * math.ldexp(1.0, power), Vec3(0.0, 0.0, 0.0)))
    assert z == n
    basis = np.array([s, t, z])
    np.testing.assert_allclose(basis @ basis.T, np.eye(3), rtol=0, atol=16 * U)
    assert np.linalg.det(basis) > 0.0
    # What is left of dp/du beside the normal shows the way, if it is more than rounding.
    rest = np.array(d) - np.array(n) * np.dot(n, d)
    if np.linalg.norm(rest) > 1e-12:
        assert np.dot(s, rest) > 0.9 * np.linalg.norm(rest)


@pytest.mark.parametrize("direction", [(0, 0, 0), (0, 0, 2), (1e-17, 0, -1), (0, 0, -5e-324)])
def test_no_direction(direction):
    z = Vec3(0.0, 0.0, 1.0)
    assert frame_along(z, Vec3(*map(float, direction))) == frame_from_normal(z)

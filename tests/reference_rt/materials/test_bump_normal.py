"""Bump and normal maps: known slopes, and frames for any tangents."""

import math

import numpy as np
import pytest
from builders import U, unit_vectors
from hypothesis import given
from hypothesis import strategies as st

from reference_rt.core.vec3 import Vec3, luminance, to_local
from reference_rt.jit.kernel import entry_kernel
from reference_rt.materials.material import oriented_frame
from reference_rt.materials.nested import tilted
from reference_rt.materials.nested.tilted import Bump, NormalMap
from reference_rt.shapes.shape import Tangents
from reference_rt.textures.bitmap import table_of
from reference_rt.textures.checker import Checkers
from reference_rt.textures.image_file import Texels
from reference_rt.textures.lookup import NOWHERE, At, Textures, lookup, lookup_gradient
from reference_rt.textures.parameter import Palette
from reference_rt.textures.tables import BITMAP, CHECKER, UvSets
from reference_rt.textures.texture import UvMap

PALETTE = Palette({"t": 0}, [5.0])
PLAIN = UvMap()
UP = Vec3(0.0, 0.0, 1.0)
FLAT = Tangents(Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0))


OWN = UvSets(np.zeros(1, np.int64), np.zeros((0, 6)))
"""One texture with the surface's own coordinates."""


def texture(texels, uv=PLAIN, nearest=0, wrap=0):
    """One bitmap with these texels (height, width, 3), the top row first."""
    values = np.array(texels, dtype=float)
    stored = Texels(values.reshape(-1).view(np.uint8), values, np.zeros(0), 1.0, values.max())
    bitmaps = table_of(stored, nearest, 4 * wrap)
    maps, tables = uv.coefficients()[None], (None, bitmaps, None, None)
    return Textures(np.array([BITMAP]), np.array([0]), maps, *tables, OWN)


def at(textures, u, v):
    return At(textures, u, v, Vec3(-1.0, -1.0, -1.0))


def ramp(along_u, along_v, n=8):
    """Grey, but for the wrap of height along_u u + along_v v."""
    middle = (np.arange(n) + 0.5) / n
    return np.repeat((along_u * middle + along_v * (1.0 - middle[:, None]))[..., None], 3, axis=2)


def bumped(textures, tangents, u=0.5, v=0.4, scale=1.0):
    table = Bump(base="b", height="t", scale=scale).tabulate(PALETTE)
    return tilted.bump_basis(table, 0, at(textures, u, v), tangents, UP)


def mapped(textures, tangents, u=0.5, v=0.4, **fields):
    table = NormalMap(base="b", normals="t", **fields).tabulate(PALETTE)
    return tilted.map_basis(table, 0, at(textures, u, v), tangents, UP)


def assert_basis(frame, n):
    basis = np.array(frame)
    np.testing.assert_allclose(basis @ basis.T, np.eye(3), rtol=0, atol=16 * U)
    assert np.linalg.det(basis) > 0.0
    np.testing.assert_allclose(frame.n, n, rtol=0, atol=64 * U)


@pytest.mark.parametrize("nearest", [0, 1])
@pytest.mark.parametrize("wrap", [0, 1, 2])
def test_gradient_is_the_slope_of_the_lookup(nearest, wrap):
    """Under any uv map; the lookup is bilinear between middles of texels, so that differences
    within a patch are exact but for rounding over the step."""
    rng = np.random.default_rng(3)
    step = 2.0**-20
    compared = 0
    for _ in range(200):
        uv = UvMap(
            scale=tuple(rng.uniform(-2, 2, 2)),
            rotate=float(rng.uniform(0, 360)),
            offset=tuple(rng.uniform(-1, 1, 2)),
        )
        textures = texture(rng.random((3, 5, 3)), uv, nearest, wrap)
        u, v = rng.uniform(-1, 2, 2)
        m = uv.coefficients()
        x = (m[0] * u + m[1] * v + m[2]) * 5 - 0.5 * (1 - nearest)
        y = (m[3] * u + m[4] * v + m[5]) * 3 - 0.5 * (1 - nearest)
        if min(x % 1, -x % 1, y % 1, -y % 1) < 1e-4:
            continue  # next to where the patch ends
        compared += 1
        sides = [
            luminance(lookup(0, at(textures, u + a * step, v + b * step)))
            for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1))
        ]
        slopes = [(sides[0] - sides[1]) / (2 * step), (sides[2] - sides[3]) / (2 * step)]
        found = lookup_gradient(0, at(textures, u, v))
        # Along u and v at once the patch is curved, but symmetric steps do not see it.  Some
        # twenty roundings of numbers up to 20, over the step.
        np.testing.assert_allclose(found, slopes, rtol=0, atol=400 * U / step)
        if nearest == 1:
            assert found == (0.0, 0.0)
    assert compared > 150


def test_checkers_have_no_slope():
    textures = Textures(
        np.array([CHECKER]),
        np.array([0]),
        PLAIN.coefficients()[None],
        Checkers(np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])),
        None,
        None,
        None,
        OWN,
    )
    assert lookup_gradient(0, at(textures, 0.5, 0.5)) == (0.0, 0.0)
    assert bumped(textures, FLAT).n == (0.0, 0.0, 1.0)
    assert lookup_gradient(0, at(None, 0.5, 0.5)) == (0.0, 0.0)


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.75, 0.0), (0.0, 2.0), (-0.3, 1.7)])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_ramp_tilts_by_its_angle(slope, mirrored):
    """Height s x + t y over the plane: the normal (-s, -t, 1), whatever u and v measure it in."""
    s, t = slope
    size_u, size_v = 3.0, -0.5 if mirrored else 0.5
    tangents = Tangents(Vec3(size_u, 0.0, 0.0), Vec3(0.0, size_v, 0.0))
    height = ramp(s * size_u, t * size_v) + 5.0
    frame = bumped(texture(height), tangents)
    n = np.array([-s, -t, 1.0]) / math.hypot(s, t, 1.0)
    # Texels round to 8 u, and their differences are over 1/8.
    np.testing.assert_allclose(frame.n, n, rtol=0, atol=300 * U)
    assert_basis(frame, frame.n)
    assert frame.s.x > 0.0
    assert abs(frame.s.y) <= abs(frame.n.x * frame.n.y) / math.sqrt(1 - frame.n.x**2) + 8 * U


@pytest.mark.parametrize("scale", [-1.0, 0.0, 2.0])
def test_scale(scale):
    frame = bumped(texture(ramp(0.5, 0.0)), FLAT, scale=scale)
    np.testing.assert_allclose(frame.n.x / frame.n.z, -0.5 * scale, rtol=0, atol=64 * U)


VECTORS = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(lambda v: Vec3(*v))


@given(dpdu=VECTORS, dpdv=VECTORS, slope=VECTORS, power=st.integers(-600, 600))
def test_frames_for_any_tangents(dpdu, dpdv, slope, power):
    """Always a right-handed orthonormal frame; on the side of the surface where it has one."""
    size = math.ldexp(1.0, power)
    tangents = Tangents(dpdu * size, dpdv * size)
    with np.errstate(all="ignore"):
        n = tilted.tilted(slope.x, slope.y, tangents)
        frame = bumped(texture(ramp(*slope[:2])), tangents)
    assert abs(math.hypot(*n) - 1.0) <= 8 * U
    assert_basis(frame, frame.n)
    g = np.cross(dpdu, dpdv)
    if abs(g[2]) > 1e-3:
        assert np.dot(n, g) * g[2] > -1e-12
    if g[2] != 0.0 and dpdu.z == dpdv.z == 0.0:
        assert n.z >= 0.0


def test_against_the_surface_itself():
    """A plane of any placing, raised: the shading normal is that of the raised plane."""
    rng = np.random.default_rng(4)
    for _ in range(100):
        e = rng.normal(size=(2, 3))
        n = np.cross(*e) * rng.choice([-1.0, 1.0])
        n /= np.linalg.norm(n)
        s, t = rng.normal(size=2)
        raised = np.cross(e[0] + s * n, e[1] + t * n)
        raised *= np.sign(raised @ n) / np.linalg.norm(raised)
        world = Tangents(Vec3(*e[0]), Vec3(*e[1]))
        frame = oriented_frame(Vec3(*n), world)
        local = Tangents(to_local(frame, world.dpdu), to_local(frame, world.dpdv))
        found = np.array(tilted.tilted(s, t, local)) @ np.array(frame)
        condition = np.linalg.norm(e[0]) * np.linalg.norm(e[1]) / np.linalg.norm(np.cross(*e))
        np.testing.assert_allclose(found, raised, rtol=0, atol=64 * U * condition)


def test_constant_normal_map():
    """The direction 2 rgb - 1: red along dp/du, which need not be the frame's own x."""
    rng = np.random.default_rng(5)
    for n in unit_vectors(rng, 50):
        textures = texture(np.full((2, 3, 3), (n * 0.9 + 1.0) / 2.0))
        assert_basis(mapped(textures, FLAT), n)
        turn = rng.uniform(0, 2 * math.pi)
        c, s = math.cos(turn), math.sin(turn)
        tangents = Tangents(Vec3(2 * c, 2 * s, 0.0), Vec3(-s, c, 0.0))
        assert_basis(mapped(textures, tangents), [c * n[0] - s * n[1], s * n[0] + c * n[1], n[2]])


@pytest.mark.parametrize("scale", [0.5, 3.0, -1.0])
def test_the_scale_of_a_normal_map(scale):
    """It makes what lies along the surface longer, not what is along the normal."""
    n = np.array([0.3, -0.2, 0.8])
    expected = n * (scale, scale, 1.0)
    found = mapped(texture(np.full((2, 2, 3), (n + 1.0) / 2.0)), FLAT, scale=scale)
    assert_basis(found, expected / np.linalg.norm(expected))


def test_green_follows_v_where_uv_is_mirrored():
    green = texture(np.full((2, 2, 3), (0.5, 0.9, 0.9)))
    up = np.array([0.0, 1.0, 1.0]) * math.sqrt(0.5)
    mirrored = Tangents(Vec3(2.0, 0.0, 0.0), Vec3(0.1, -3.0, 0.0))
    assert_basis(mapped(green, FLAT, follow_v=True), up)
    assert_basis(mapped(green, mirrored, follow_v=True), up * (1.0, -1.0, 1.0))
    assert_basis(mapped(green, mirrored), up)


def test_normal_maps_that_change_nothing():
    """Blue leaves the frame along dp/du; so does what is no direction."""
    along_y = Tangents(Vec3(0.0, 2.0, 0.5), Vec3(1.0, 0.0, 0.0))
    for rgb in ((0.5, 0.5, 1.0), (0.5, 0.5, 0.75), (0.5, 0.5, 0.5)):
        frame = mapped(texture(np.full((2, 2, 3), rgb)), along_y)
        assert_basis(frame, (0.0, 0.0, 1.0))
        np.testing.assert_array_equal(frame.s, (0.0, 1.0, 0.0))
    lying = mapped(texture(np.full((2, 2, 3), (0.5, 1.0, 0.5))), along_y)
    assert_basis(lying, (-1.0, 0.0, 0.0))


@entry_kernel
def _bases(bumps, maps, textures, u, v, tangents, out):
    at = At(textures, u, v, Vec3(-1.0, -1.0, -1.0), NOWHERE)
    for k, frame in enumerate(
        (tilted.bump_basis(bumps, 0, at, tangents, UP), tilted.map_basis(maps, 0, at, tangents, UP))
    ):
        out[k, 0], out[k, 1], out[k, 2] = frame.s
        out[k, 3], out[k, 4], out[k, 5] = frame.t
        out[k, 6], out[k, 7], out[k, 8] = frame.n


@pytest.mark.slow
def test_compiled():
    """The same bits as in plain Python."""
    rng = np.random.default_rng(6)
    textures = texture(rng.random((4, 4, 3)), UvMap(rotate=30.0))
    tables = (
        Bump(base="b", height="t").tabulate(PALETTE),
        NormalMap(base="b", normals="t").tabulate(PALETTE),
    )
    for e in rng.normal(size=(20, 2, 3)):
        tangents = Tangents(*(Vec3(*map(float, v)) for v in e))
        u, v = map(float, rng.uniform(-1, 2, 2))
        out = np.zeros((2, 9))
        _bases(*tables, textures, u, v, tangents, out)
        expected = bumped(textures, tangents, u, v), mapped(textures, tangents, u, v)
        np.testing.assert_array_equal(out, np.array(expected).reshape(2, 9))

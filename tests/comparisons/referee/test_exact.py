"""Exact arithmetic against fractions and closed forms; no renderer takes part."""

from fractions import Fraction

import numpy as np
import pytest

from comparisons.geometry.exact.dyadic import NEVER, Dyadic, dot, nearest, quotient, roots, tied
from comparisons.referee import all_hits, columns_of, first_hit
from comparisons.referee.sizes import LeafSizes, ShapeSizes
from comparisons.shapes import type_of
from reference_rt.core.transform import Rotate, Scale, Turn
from reference_rt.rendering.scene import Scene
from reference_rt.scene.examples import examples
from reference_rt.shapes import Mesh, Primitive, Shape


def leaf(shape: str | Shape) -> LeafSizes:
    if not isinstance(shape, str):
        return ShapeSizes(Scene(shapes=(shape,))).leaves[0]
    return ShapeSizes(Scene.parse(f"shapes:\n  - {shape}\n")).leaves[0]


def first(shape: str, o: object, d: object) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    found = leaf(shape)
    hit = first_hit(found.field, columns_of(found.table), o, d)
    return hit.t, hit.code, hit.touching


# ---- numbers ------------------------------------------------------------------------------------


def test_sums_and_products_are_those_of_fractions() -> None:
    rng = np.random.default_rng(1)
    a, b = (rng.normal(size=(200, 3)) * 10.0 ** rng.uniform(-30, 30, (200, 3)) for _ in "ab")
    a[:20], b[5:30] = 0.0, -0.0
    found = dot(Dyadic.of(a) - Dyadic.of(b), Dyadic.of(a) * Dyadic.of(b))
    for k in range(200):
        exact = sum(
            (Fraction(x) - Fraction(y)) * Fraction(x) * Fraction(y)
            for x, y in zip(a[k].tolist(), b[k].tolist(), strict=True)
        )
        assert Fraction(int(found.n[k])) * Fraction(2) ** found.e == exact
    np.testing.assert_array_equal(Dyadic.of(a).floats(), a)


def test_roots_are_enclosed() -> None:
    """f changes its sign between the floats beside a root, in fractions."""
    rng = np.random.default_rng(2)
    a, b, c = rng.normal(size=(3, 300))
    a[:50] *= 1e-30
    sign, near, far = roots(*(Dyadic.of(x) for x in (a, b, c)))
    for k in range(300):
        f = [Fraction(float(x[k])) for x in (a, b, c)]
        assert sign[k] == np.sign(f[1] ** 2 - f[0] * f[2])
        if sign[k] < 0:
            continue
        for t in (near, far):
            middle = nearest(t)[k]
            ends = [
                Fraction(x) for x in (np.nextafter(middle, -np.inf), np.nextafter(middle, np.inf))
            ]
            values = [f[0] * x * x + 2 * f[1] * x + f[2] for x in ends]
            assert values[0] * values[1] <= 0


def test_degenerate_equations() -> None:
    one, two, zero = (Dyadic.of([x]) for x in (1.0, 2.0, 0.0))
    # Of a line, f <= 0 up to its zero where it rises, and from there on where it falls.
    sign, near, far = roots(zero, one, -two)  # 2 t - 2
    assert (sign[0], near[0], nearest(far)[0]) == (1, -NEVER, 1.0)
    sign, near, far = roots(zero, -one, -two)  # -2 t - 2
    assert (sign[0], nearest(near)[0], far[0]) == (1, -1.0, NEVER)
    sign, near, far = roots(one, -one, one)  # (t - 1)²
    assert sign[0] == 0
    assert tied(near, far)[0]
    assert roots(zero, zero, one)[0][0] == -1
    assert quotient(one, zero)[0] == NEVER


# ---- shapes -------------------------------------------------------------------------------------

X = [[1.0, 0.0, 0.0]]

CLOSED_FORMS = (
    ("{type: sphere, center: [3, 0, 0], radius: 0.5}", [0, 0, 0], 2.5, 0),
    ("{type: sphere, center: [3, 0, 0], radius: 4}", [0, 0, 0], 7.0, 0),
    ("{type: sphere, transform: [{scale: [2, 1, 1]}, {translate: [5, 0, 0]}]}", [0, 0, 0], 3.0, 0),
    ("{type: box, transform: [{scale: [0.5, 1, 1]}, {translate: [2, 0, 0]}]}", [0, 0, 0], 1.5, 0),
    ("{type: box, transform: [{scale: [0.5, 1, 1]}, {translate: [2, 0, 0]}]}", [2, 0, 0], 0.5, 3),
    ("{type: torus}", [-4, 0, 0], 2.75, 0),
    ("{type: torus}", [-1, 0, 0], 0.25, 0),
    ("{type: torus}", [0, 0, 0], 0.75, 0),
    ("{type: cylinder, transform: [{rotate: {axis: [0, 1, 0], degrees: 90}}]}", [-4, 0.5, 0], 4, 3),
    ("{type: cylinder}", [-4, 0, 0.5], 3.0, 0),
    ("{type: cone, height: 2}", [-4, 0, 1.0], 3.5, 0),
    ("{type: triangle, v0: [1, -1, -1], v1: [1, 1, -1], v2: [1, 0, 1]}", [0, 0, 0], 1.0, 0),
    (
        "{type: rectangle, transform: [{rotate: {axis: [0, 1, 0], degrees: 90}}]}",
        [-2, 0, 0.5],
        2,
        0,
    ),
    ("{type: disk, transform: [{rotate: {axis: [0, 1, 0], degrees: 90}}]}", [-2, 0.6, 0.6], 2, 0),
    (
        "{type: disk, transform: [{rotate: {axis: [0, 1, 0], degrees: 90}}]}",
        [-2, 0.8, 0.8],
        None,
        0,
    ),
    ("{type: plane, transform: [{rotate: {axis: [0, 1, 0], degrees: 90}}]}", [-2, 9e9, 7], 2.0, 0),
)


@pytest.mark.parametrize(("shape", "o", "t", "code"), CLOSED_FORMS)
def test_closed_forms(shape: str, o: list[float], t: float | None, code: int) -> None:
    found, codes, touching = first(shape, [o], X)
    assert not touching[0]
    if t is None:
        assert found[0] == np.inf
        assert codes[0] == -1
    else:
        assert found[0] == t
        assert codes[0] == code
    # A direction of another length counts t in its units; all numbers here are dyadic.
    again, _, _ = first(shape, [o], [[2.0**-40, 0.0, 0.0]])
    assert again[0] == found[0] * 2.0**40


def test_tangents_to_the_last_bit() -> None:
    """The unit sphere from beside: hit, touched and missed at neighbouring floats."""
    y = np.array([np.nextafter(1.0, 0.0), 1.0, np.nextafter(1.0, 2.0)])
    o = np.column_stack([np.full(3, -2.0), y, np.zeros(3)])
    t, _, touching = first("{type: sphere}", o, np.repeat(X, 3, axis=0))
    assert np.isfinite(t).tolist() == [True, True, False]
    assert touching.tolist() == [False, True, False]


def test_edges_and_corners_are_reported() -> None:
    for shape, o in (
        ("{type: box}", [-2.0, 1.0, 0.3]),  # in the plane of a face
        ("{type: triangle, v0: [1, 0, 0], v1: [1, 1, 0], v2: [1, 0, 1]}", [0.0, 0.0, 0.25]),
        ("{type: disk, transform: [{rotate: {axis: [0, 1, 0], degrees: 90}}]}", [-2.0, 1.0, 0.0]),
        ("{type: cylinder}", [-2.0, 0.0, 1.0]),  # in the plane of a cap
        ("{type: torus}", [-4.0, 0.0, 0.25]),  # along its top
    ):
        _, _, touching = first(shape, [o], X)
        assert touching[0], shape
        _, _, touching = first(shape, [[*o[:2], o[2] + 2.0**-30]], [[1.0, 2.0**-31, 2.0**-32]])
        assert not touching[0], shape


STAR = "[[0, 1], [0.588, -0.809], [-0.951, 0.309], [0.951, 0.309], [-0.588, -0.809]]"


@pytest.mark.parametrize(("fill", "middle"), [("even_odd", False), ("nonzero", True)])
def test_fill_rules(fill: str, middle: bool) -> None:
    shape = f"{{type: polygon, fill: {fill}, rings: [{STAR}]}}"
    o = [[0.0, 0.0, 2.0], [0.0, 0.8, 2.0], [0.7, 0.7, 2.0]]
    t, _, _ = first(shape, o, [[0.0, 0.0, -1.0]] * 3)
    assert np.isfinite(t).tolist() == [middle, True, False]


SHAPES = [
    shape.model_copy(update={"transform": tuple(steps)})
    for shape in examples(Primitive)
    if not isinstance(shape, Mesh)
    for steps in ([], [Rotate(rotate=Turn(axis=(1, 2, 3), degrees=40)), Scale(scale=(1, 0.7, 1.2))])
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.type)
@pytest.mark.parametrize(
    "rays", [150, pytest.param(100_000, marks=pytest.mark.slow)], ids=["few", "1e5"]
)
def test_crossings_alternate_and_do_not_depend_on_where_a_ray_begins(
    shape: Shape, rays: int
) -> None:
    """Of a solid a line enters as often as it leaves, in turns; a ray that begins further along
    finds the same crossings, exactly that much earlier."""
    found = leaf(shape)
    row = columns_of(found.table)
    rng = np.random.default_rng(3)
    # Floats of few bits, so that o + 2 d is exact.
    o = rng.integers(-(2**20), 2**20, (rays, 3)) * 2.0**-19
    d = rng.integers(-(2**20), 2**20, (rays, 3)) * 2.0**-20 - o
    hits, later = (all_hits(found.field, row, x, d) for x in (o, o + 2.0 * d))
    there = hits.t != NEVER
    assert there.any(axis=1).mean() > 0.05
    moved = np.where(there, later.t + (2 << 384), NEVER)
    assert tied(hits.t, moved)[there].all()
    np.testing.assert_array_equal(hits.enters[there], later.enters[there])
    np.testing.assert_array_equal(hits.code[there], later.code[there])
    if type_of(shape).encloses(shape) and found.is_finite:
        assert (there.sum(axis=1) % 2 == 0)[~hits.touching].all()
        turns = np.arange(there.shape[1]) % 2 == 0
        assert (hits.enters == turns)[there].all()


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.type)
def test_scales_do_not_matter(shape: Shape) -> None:
    """A power of two of everything leaves t as it is, and of the direction alone divides it."""
    found = leaf(shape)
    row = dict(columns_of(found.table))
    rng = np.random.default_rng(4)
    o = rng.uniform(-2.0, 2.0, (100, 3))
    d = rng.uniform(-1.0, 1.0, (100, 3)) - o
    plain = first_hit(found.field, row, o, d)
    for scale in (2.0**-200, 2.0**200):
        again = first_hit(found.field, row, o, d * scale)
        np.testing.assert_array_equal(again.t * scale, plain.t)
        np.testing.assert_array_equal(again.code, plain.code)

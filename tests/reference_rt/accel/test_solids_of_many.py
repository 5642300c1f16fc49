"""Solids of many operands, of which a ray is tested against few: the same bits as by walking
through all crossings of all operands (`plain_solids`)."""

import math
from itertools import pairwise
from unittest import mock

import numpy as np
import pytest
from builders import icosphere, in_plain_python, same_in_plain_python, unit_vectors
from placed_shapes import lattice_rays, random_map
from plain_solids import inside, plain_crossings

import reference_rt as rt
from reference_rt.accel import csg
from reference_rt.core import transform
from reference_rt.rendering.query.crossings import solid_crossings
from reference_rt.shapes import TABLES
from reference_rt.shapes.csg import Difference, Intersection, Union, gates_of, postfix

KINDS = ("sphere", "box", "cylinder", "cone", "quadric", "torus", "mesh", "plane")
MOST = 16
BALL = icosphere(1)

FAR = (transform.Translate(translate=(0.0, 0.0, -1e9)),)
ELSEWHERE = (
    rt.Sphere(transform=FAR),
    rt.Box(transform=FAR),
    rt.Cylinder(transform=FAR),
    rt.Cone(transform=FAR),
    rt.Quadric(
        coefficients=(1, 1, 1, 0, 0, 0, 0, 0, 0, -1), lower=(-1,) * 3, upper=(1,) * 3, transform=FAR
    ),
    rt.Torus(transform=FAR),
    # Mirrored, as some operands are: its triangles keep their uv.
    rt.Mesh(
        vertices=BALL[0], faces=BALL[1], transform=(transform.Scale(scale=(-1.0, 1.0, 1.0)), *FAR)
    ),
    rt.Intersection(of=(rt.Box(), rt.Plane()), transform=FAR),
)
"""Out of the way: scenes have the same kinds of shapes, and share kernels."""


def of_kind(kind, rng):
    """A shape of about unit size that encloses space."""
    return {
        "sphere": lambda: rt.Sphere(radius=float(rng.uniform(0.5, 1.0))),
        "box": rt.Box,
        "cylinder": lambda: rt.Cylinder(radius=0.7, z_min=-0.9, z_max=0.8),
        "cone": lambda: rt.Cone(radius=1.0, height=1.4, top_radius=float(rng.choice([0.0, 0.3]))),
        "quadric": lambda: rt.Quadric(
            coefficients=(1, 1, -0.5, 0, 0, 0, 0, 0, 0, -0.3),
            lower=(-1, -1, -1), upper=(1, 1, 1), capped=True,
        ),
        "torus": lambda: rt.Torus(major_radius=0.8, minor_radius=0.3),
        "mesh": lambda: rt.Mesh(vertices=BALL[0], faces=BALL[1]),
        "plane": rt.Plane,
    }[kind]()  # fmt: skip


def moved(shape, *steps):
    return shape.model_copy(update={"transform": (*shape.transform, *steps)})


def anywhere(rng, n, planes=0.03):
    """n operands of all kinds in [-1, 1]^3, under any affine maps; small ones, so that rays find
    some, and a few as large as all of them.  planes: the share of infinite ones."""
    found = []
    size = 0.5 * n ** (-1 / 3)
    for _ in range(n):
        kind = KINDS[-1] if rng.random() < planes else KINDS[rng.integers(len(KINDS) - 1)]
        factor = size * float(rng.choice([0.5, 1.0, 2.0, 1.0 / size]))
        shift = tuple(rng.uniform(-1, 1, 3).tolist())
        steps = random_map(rng, 0.2, 0.2), {"scale": factor}, {"translate": shift}
        found.append(moved(of_kind(kind, rng), *(as_step(s) for s in steps)))
    return found


def as_step(step):
    if not isinstance(step, dict):
        return step
    if "scale" in step:
        return transform.Scale(scale=(step["scale"],) * 3)
    return transform.Translate(**step)


def on_lattice(rng, n):
    """n boxes, and balls in them, with faces and poles on integers: many coincide, and some are
    there twice."""
    found = []
    for _ in range(n):
        shape = rt.Box() if rng.random() < 0.8 else rt.Sphere()
        half = rng.integers(1, 3, 3) / 2.0 if isinstance(shape, rt.Box) else [0.5] * 3
        place = rng.integers(-2, 3, 3) + np.asarray(half)
        found.append(
            moved(
                shape,
                transform.Scale(scale=tuple(np.asarray(half).tolist())),
                transform.Translate(translate=tuple(place.tolist())),
            )
        )
        if rng.random() < 0.1:
            found[-1] = found[rng.integers(len(found))]
    return found


def combined(rng, parts):
    """A random expression of all of these, from left to right; some of it under a map."""
    if len(parts) == 1 and rng.random() < 0.8:
        return parts[0]
    kind = rng.choice([Union, Difference, Intersection], p=[0.75, 0.2, 0.05])
    if len(parts) <= 8 and rng.random() < 0.5:
        of = tuple(parts)
    else:
        ends = np.unique(rng.integers(1, len(parts), min(len(parts) - 1, rng.integers(1, 9))))
        cuts = [0, *ends.tolist(), len(parts)]
        of = tuple(combined(rng, parts[a:b]) for a, b in pairwise(cuts))
    shape = kind(of=of)
    return moved(shape, random_map(rng, 0.05, 0.05)) if rng.random() < 0.1 else shape


def solid_of(shape):
    """As a solid, also of a single operand."""
    return shape if isinstance(shape, Union | Difference | Intersection) else Union(of=(shape,))


def rays_around(rng, n, scene):
    """From outside, inside and far away, along axes too; and from points of the surface."""
    o = rng.uniform(-1.5, 1.5, (n, 3)) * rng.choice([1.0, 1.0, 3.0, 1e4], (n, 1))
    d = (rng.uniform(-1, 1, (n, 3)) - o) * 2.0 ** rng.integers(-3, 4, (n, 1))
    along = rng.random(n) < 0.2
    d[along] = np.concatenate([np.eye(3), -np.eye(3)])[rng.integers(0, 6, along.sum())]
    hits = scene.intersect(o, d)
    on = hits.p[(hits.shape == 0) & (np.abs(o).max(axis=1) < 10.0)]
    return np.concatenate([o, on]), np.concatenate([d, unit_vectors(rng, len(on))])


def grazing(rng, boxes, n):
    """Rays through corners and along edges of the operands' boxes, to the last bit."""
    (lower, upper), k = boxes, rng.integers(0, len(boxes[0]), n)
    sides = rng.random((2, n, 3)) < 0.5
    a, b = (np.where(side, lower[k], upper[k]) for side in sides)
    d = np.where((np.abs(b - a) > 0).any(axis=1, keepdims=True), b - a, [1.0, 0.0, 0.0])
    return np.nextafter(a - d, rng.choice([-np.inf, np.inf], (n, 3))), d


def same_as_plain(shape, o, d, scene=None):
    """All crossings, the first one and shadows, bit for bit.  How many rays meet the solid."""
    scene = scene or rt.Scene(shapes=(shape, *ELSEWHERE))
    geometry = scene.tables.geometry
    found = solid_crossings(scene.tables, 0, o, d, MOST)
    t, widths, part, count = plain_crossings(geometry, 0, shape, o, d, MOST)
    assert np.array_equal(found.count, count)
    assert np.array_equal(found.part, part)
    assert found.t.tobytes() == t.tobytes()
    assert found.width.tobytes() == widths.tobytes()
    hits = scene.intersect(o, d)
    first = np.where(hits.hit & (hits.shape == 0), hits.t, math.inf)
    assert first.tobytes() == t[:, 0].tobytes()
    assert np.array_equal(hits.part[np.isfinite(first)], part[np.isfinite(first), 0])
    # Rays that end before it, at it and beyond.
    ends = np.where(t[:, 0] < math.inf, t[:, 0], 1.0)
    for end in (0.9 * ends, ends, np.nextafter(ends, math.inf), 1.1 * ends):
        assert np.array_equal(scene.occluded(o, d, end) & (first < math.inf), t[:, 0] < end)
    return (count > 0).sum()


def test_expressions_of_1_to_300_operands_keep_their_bits():
    rng, met = np.random.default_rng(11), 0
    for n in (1, 2, 5, 8, 9, 20, 20, 60, 60, 60, 300):
        shape = solid_of(combined(rng, anywhere(rng, n)))
        scene = rt.Scene(shapes=(shape, *ELSEWHERE))
        met += same_as_plain(shape, *rays_around(rng, 150, scene), scene)
    assert met > 250


@pytest.mark.slow
def test_many_expressions_keep_their_bits():
    rng, met = np.random.default_rng(12), 0
    for _ in range(100):
        n = int(10 ** rng.uniform(0, 2.48))
        planes = float(rng.choice([0.0, 0.03, 0.5]))
        shape = solid_of(combined(rng, anywhere(rng, n, planes)))
        scene = rt.Scene(
            shapes=(shape, *ELSEWHERE), hierarchy=str(rng.choice(["auto", "median", "none"]))
        )
        met += same_as_plain(shape, *rays_around(rng, 60, scene), scene)
    assert met > 2_000


@pytest.mark.parametrize("kind", [Union, Difference, Intersection])
def test_coincident_faces_keep_their_bits(kind):
    """Boxes and balls on a lattice, by rays on it and beside it, through edges and corners."""
    rng = np.random.default_rng(13)
    o, d = lattice_rays(2)
    some = rng.choice(len(o), 120, replace=False)
    o, d = 1.5 * o[some], d[some]
    o[::3] += rng.uniform(-0.5, 0.5, (40, 3))
    parts = on_lattice(rng, 40)
    met = same_as_plain(combined(rng, parts), o, d)
    # All in one operation, in a body that is larger than they are.
    body = moved(rt.Box(), transform.Scale(scale=(2.5,) * 3))
    whole = [body, *parts] if kind is Difference else parts
    if kind is Intersection:  # of what is outside of each
        shape = Intersection(of=(body, *(Difference(of=(body, part)) for part in parts)))
    else:
        shape = kind(of=tuple(whole))
    met += same_as_plain(shape, o, d)
    assert met > 60


def test_rays_that_graze_the_boxes_of_operands():
    rng = np.random.default_rng(14)
    for shape in (Union(of=tuple(on_lattice(rng, 30))), Union(of=tuple(anywhere(rng, 60, 0.0)))):
        scene = rt.Scene(shapes=(shape, *ELSEWHERE))
        same_as_plain(shape, *grazing(rng, boxes_of(scene), 300), scene)


def test_operands_a_hair_apart_keep_their_bits():
    """Slices of a block, so close that rounding may take two crossings for one, or not, also where
    a node's box begins: a ray that comes to that node must not lose what is in it further on."""
    rng, gap = np.random.default_rng(18), 1e-9
    ends = np.sort(rng.uniform(-1.0, 1.0, 401))
    parts = tuple(
        moved(
            rt.Box(),
            transform.Scale(scale=((b - a - gap) / 2.0, 0.5, 0.5)),
            transform.Translate(translate=((a + b) / 2.0, 0.0, 0.0)),
        )
        for a, b in pairwise(ends.tolist())
    )
    o = np.column_stack([np.full(4, -3.0), rng.uniform(-0.4, 0.4, (4, 2))])
    d = np.column_stack([np.ones(4), 0.02 * rng.normal(size=(4, 2))])
    for shape in (Union(of=parts), Difference(of=(rt.Box(), *parts))):
        assert same_as_plain(shape, o, d) == 4


def boxes_of(scene):
    """The boxes (m, 3), (m, 3) of the operands of a scene's first solid that are no meshes."""
    geometry = scene.tables.geometry
    solids, lower, upper = geometry.solids, [], []
    for k in range(solids.operands[0]):
        kind, row = solids.kind[k], solids.row[k]
        if row >= 0:
            _, field, _, module = TABLES[kind]
            low, high = module.bounds(getattr(geometry.shapes, field))
            lower.append(low[row])
            upper.append(high[row])
    return np.array(lower), np.array(upper)


def write_crossings(_folder, file):
    rng, found = np.random.default_rng(16), {}
    for n in (3, 12, 40):
        parts = on_lattice(rng, n) if n == 12 else anywhere(rng, n)
        scene = rt.Scene(shapes=(solid_of(combined(rng, parts)), *ELSEWHERE))
        o = rng.uniform(-2.0, 2.0, (12, 3))
        crossed = solid_crossings(scene.tables, 0, o, rng.uniform(-1.0, 1.0, o.shape) - o, MOST)
        found |= {f"{n} {name}": column for name, column in vars(crossed).items()}
    np.savez(file, **found)


def test_compiled_as_in_plain_python(tmp_path):
    compiled = same_in_plain_python(write_crossings, tmp_path)
    assert sum((compiled[f"{n} count"] > 0).sum() for n in (3, 12, 40)) > 12


NUMBERS = (4, 32, 256)


def write_operands_tested(file):
    """For unions of NUMBERS of balls of the same total volume, and a box less these: for how many
    operands a ray computes crossings on its way to the first hit.  In plain Python."""
    rng, tested = np.random.default_rng(17), np.zeros((2, len(NUMBERS)))
    o = 3.0 * unit_vectors(rng, 30)
    d = rng.uniform(-1.0, 1.0, o.shape) - o
    for k, n in enumerate(NUMBERS):
        radius = 0.5 * n ** (-1 / 3)
        balls = [rt.Sphere(center=c, radius=radius) for c in rng.uniform(-1, 1, (n, 3)).tolist()]
        for operation, shape in enumerate((Union(of=balls), Difference(of=(rt.Box(), *balls)))):
            scene = rt.Scene(shapes=(shape,))
            with mock.patch.object(csg, "_come_to", side_effect=csg._come_to) as come_to:
                assert scene.intersect(o, d).hit.any()
            tested[operation, k] = come_to.call_count / len(o)
    np.save(file, tested)


def test_a_ray_is_tested_against_few_operands(tmp_path):
    """A line meets as many balls as the cube root of their number, and the first hit needs fewer.
    Measured: 4, 3 and 5 of the union, 5, 2 and 3 of the box."""
    in_plain_python(__file__, "write_operands_tested", tmp_path / "tested.npy")
    tested = np.load(tmp_path / "tested.npy")
    assert (tested < 8.0).all()


def test_gates_say_what_the_expression_says():
    """For any states of the operands, switched one after another."""
    rng = np.random.default_rng(15)
    for n in (1, 2, 3, 7, 30):
        for _ in range(20):
            shape = solid_of(combined(rng, [rt.Sphere()] * n))
            gates = gates_of(postfix(shape))
            outside = holds(gates, [False] * n)
            # The solid changes with gate 0: relative to where all operands are outside.
            is_inside = inside(shape, iter([False] * n))
            for _ in range(20):
                states = (rng.random(n) < 0.5).tolist()
                changed = holds(gates, states) != outside
                assert inside(shape, iter(states)) == (is_inside != changed)
    for kind in (Union, Difference, Intersection):
        assert len(gates_of(postfix(kind(of=(rt.Sphere(),) * 9))).gate_up) == 1


def holds(gates, states):
    """Whether gate 0 is on, by the rules of `Gates`; where all are outside also what `start`
    says."""
    on = [0] * len(gates.gate_up)
    for to, state in zip(gates.up, states, strict=True):
        on[to >> 1] += state != (to & 1 == 1)
    for k in range(len(on) - 1, 0, -1):
        to = gates.gate_up[k]
        on[to >> 1] += (on[k] > 0) != (to & 1 == 1)
    assert any(states) or on == gates.start
    return on[0] > 0

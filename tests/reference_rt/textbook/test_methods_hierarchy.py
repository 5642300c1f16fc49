"""One scene by every hierarchy: the same hits, bit for bit."""

import numpy as np
import pytest
from builders import icosphere, placed, random_shape, unit_vectors, write_obj

import reference_rt as rt
from reference_rt import textbook
from reference_rt.accel import bvh
from reference_rt.core import transform


def crowd(rng, n):
    """Shapes of all kinds within 4 of the origin, small ones and some large."""
    kinds = ("sphere", "rectangle", "box", "triangle")
    return [random_shape(kinds[k % 4], rng, 10.0 ** rng.uniform(-2, -0.3), 4.0) for k in range(n)]


@pytest.fixture
def scene(tmp_path):
    """A crowd, a mesh, a solid, copies of a group, and a plane without end."""
    rng = np.random.default_rng(1)
    file = str(write_obj(tmp_path / "ball.obj", *icosphere(2)))
    copies = [rt.Instance(group="pair", transform=placed(rng, 0.5, 4.0)) for _ in range(20)]
    return rt.Scene(
        groups={"pair": (rt.Sphere(radius=0.5), rt.Box(transform=placed(rng, 0.3, 1.0)))},
        shapes=(
            *crowd(rng, 200),
            rt.Mesh(file=file, transform=placed(rng, 0.5, 2.0)),
            rt.Box(transform=placed(rng, 0.8, 2.0)) - rt.Sphere(radius=1.5),
            *copies,
            rt.Plane(transform=(transform.Translate(translate=(0.0, 0.0, -5.0)),)),
        ),
    )


def rays(n):
    """From within and around; a third along the axes."""
    rng = np.random.default_rng(2)
    d = unit_vectors(rng, n)
    d[::3] = np.eye(3)[rng.integers(0, 3, len(d[::3]))] * rng.choice([-1, 1], (len(d[::3]), 1))
    return rng.uniform(-6, 6, (n, 3)), d


@pytest.mark.slow
def test_all_find_the_same(scene):
    o, d = rays(5000)
    expected = scene.intersect(o, d).t
    assert 0.2 * len(o) < np.isfinite(expected).sum() < len(o)
    for name in textbook.names("hierarchy"):
        t = textbook.intersect(name, textbook.SceneParameters(scene), o, d)
        assert np.array_equal(t, expected), name


def test_each_builds_what_it_says():
    """One leaf; halves; the heuristic's nodes; references in several leaves.  Over long thin
    triangles, which pay to be cut."""
    rng = np.random.default_rng(3)
    ends = rng.uniform(-4, 4, (500, 2, 3))
    shapes = [
        rt.Triangle(v0=tuple(a), v1=tuple(b), v2=tuple(b + 0.1 * unit_vectors(rng, 1)[0]))
        for a, b in ends
    ]
    scene = textbook.SceneParameters(rt.Scene(shapes=tuple(shapes)))
    none, median, sah, spatial = (
        textbook.METHODS[f"hierarchy.{name}"].prepare(scene).bvh
        for name in ("none", "median", "sah", "spatial")
    )
    # 63 leaves of eight in 8 nodes under a root, all with the same box.
    assert len(none.boxes) == 9
    assert len(np.unique(none.boxes[1:, :6], axis=0)) == 1
    assert all(len(tree.references) == 500 for tree in (none, median, sah))
    assert 500 < len(spatial.references) <= 1000
    assert not np.array_equal(median.boxes, sah.boxes)
    costs = [bvh.of_wide(tree).sah_cost for tree in (none, median, sah, spatial)]
    assert costs[0] > max(costs[1:])

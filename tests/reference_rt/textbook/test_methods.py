"""All methods by name: which there are, what is refused, that they agree, also as plain Python."""

import math

import numpy as np
import pytest
from method_checks import CUBE, EXAMPLES, L_SHAPE, PICTURE, SCENE, TRIANGLE, UNIT_SPHERE

import reference_rt as rt
from reference_rt import textbook


def test_names():
    assert {f: len(textbook.names(f)) for f in EXAMPLES} == {
        "sphere": 3,
        "box": 4,
        "triangle": 7,
        "polygon": 4,
        "csg": 2,
        "hierarchy": 4,
        "picture": 3,
    }
    assert set(textbook.names()) == set(textbook.METHODS)
    assert {m.row for m in textbook.METHODS.values()} == {
        *("T3", "T5", "T7", "T8", "T9", "T12", "T18")
    }
    for name, method in textbook.METHODS.items():
        assert method.name == name
        assert method.summary
        assert method.source


@pytest.mark.parametrize(
    ("expected", "call"),
    [
        (r"unknown method 'sphere\.x'; expected one of sphere\.algebraic, ", ("sphere.x", CUBE)),
        (r"box\.slabs_ieee takes BoxParameters, got Sphere", ("box.slabs_ieee", UNIT_SPHERE)),
        (r"radius: .* above 0, got -1", ("sphere.robust", UNIT_SPHERE._replace(radius=-1))),
        (r"center: expected three", ("sphere.robust", UNIT_SPHERE._replace(center=(0, 0)))),
        (r"v1: expected three finite", ("triangle.lu", TRIANGLE._replace(v1=(0, 0, math.nan)))),
        (r"expected lower <= upper", ("box.six_planes", CUBE._replace(upper=(1, -2, 1)))),
        (r"at least one ring", ("polygon.winding", L_SHAPE._replace(rings=[]))),
        (r"three vertices in each", ("polygon.winding", L_SHAPE._replace(rings=[np.eye(3)[:2]]))),
        (r"ring: expected points", ("polygon.winding", L_SHAPE._replace(rings=[np.eye(4)]))),
        (r"no area", ("polygon.winding", L_SHAPE._replace(rings=[np.ones((4, 3))]))),
        (
            r"a rectangle encloses no space",
            ("csg.intervals", textbook.CsgParameters(rt.Rectangle())),
        ),
        (r"takes CsgParameters, got Sphere", ("csg.intervals", UNIT_SPHERE)),
        (r"takes SceneParameters, got Box", ("hierarchy.sah", CUBE)),
        (r"triangles and meshes", ("picture.rasterise", textbook.SceneParameters(SCENE))),
        (r"1 rays; expected those of all", ("picture.rasterise", EXAMPLES["picture"])),
        (
            r"perspective, without clipping",
            ("picture.cast", textbook.SceneParameters(PICTURE.changed(camera=rt.Orthographic()))),
        ),
        (r"0\.577 off", ("polygon.winding", L_SHAPE._replace(rings=[[*np.eye(3), (0, 0, 0)]]))),
    ],
)
def test_refusals(expected, call):
    with pytest.raises(ValueError, match=expected):
        textbook.intersect(*call, [[0, 0, 0]], [[0, 0, 1]])


def test_refused_families_and_rays():
    with pytest.raises(ValueError, match="unknown family 'cube'; expected one of sphere, tri"):
        textbook.names("cube")
    for bad in ([0, 0, 1], [[0, 0, 0]], [[0, math.inf, 1]], [[0, 0, 1], [0, 0, 1]]):
        with pytest.raises(ValueError, match=r"expected (two \(n, 3\) arrays|finite)"):
            textbook.intersect("sphere.robust", UNIT_SPHERE, [[0, 0, 0]], bad)


def test_hierarchies_find_what_renders():
    """Bit for bit: `tests/reference_rt/accel` has what each of them builds, and more scenes."""
    rng = np.random.default_rng(2)
    o = rng.uniform(-2, 2, (2000, 3))
    d = rng.uniform(-1, 1, (2000, 3)) - o
    expected = SCENE.intersect(o, d).t
    assert 0.2 * len(o) < np.isfinite(expected).sum() < len(o)
    for name in textbook.names("hierarchy"):
        t = textbook.intersect(name, textbook.SceneParameters(SCENE), o, d)
        assert np.array_equal(t, expected), name

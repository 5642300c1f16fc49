"""POV-Ray's votes: right scenes are confirmed, mistakes that two renderers share are seen."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders import SCENES

import reference_rt as rt
from comparisons.compare.budget import Budget
from comparisons.compare.compare import Subject, budgeted, compare_scene
from comparisons.geometry import affine
from comparisons.povray.run import program
from comparisons.renderers import NoCounterpartError, other
from comparisons.rungs.noise_free import vote_of_hits, vote_of_picture
from comparisons.rungs.witness import witness_of
from reference_rt.core.transform import Matrix
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ReferenceUnavailableError

try:
    program()
except ReferenceUnavailableError as error:
    pytest.skip(str(error), allow_module_level=True)

POVRAY = other("povray")
OURS, THEIRS, MITSUBAS = "ours", "POV-Ray's", "Mitsuba's"


def heard(scene, sides=(OURS, MITSUBAS), picture=None):
    """The rung of a scene whose two sides show the same picture, ours if none is given."""
    if picture is None:
        deterministic = scene.integrator.type == "whitted"
        picture = render(scene).colour if deterministic else np.zeros((1, 1, 3))
    hear = witness_of("povray", scene, 0.005, 2, lambda line: None)
    return hear((picture[None], picture[None]), sides)[0]


def small(name, width, height, spp=1):
    """A scene of scenes/ as `compare` renders it, small."""
    scene = budgeted(Scene.load(SCENES / f"{name}.yaml"), Budget(size=(width, height), spp=4))
    if scene.integrator.type == "whitted":
        scene = scene.changed(sampler=rt.Grid(spp=spp))
    return scene


# ---- right scenes --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["csg_whitted", "csg_mirrors", "csg_die_lights", "whitted_classic", "spheres_whitted"]
)
def test_pictures_and_first_hits_are_confirmed(name):
    rung = heard(small(name, 72, 48, 4))
    assert rung.status == "agree", rung.reason
    assert "pixels are POV-Ray's within 0.1 %" in rung.reason
    assert "first hits are POV-Ray's" in rung.reason
    assert rung.numbers["version"].startswith("3.7.")


def test_first_hits_alone_are_confirmed_where_the_picture_is_none_of_povrays():
    rung = heard(small("csg_textured", 60, 40))
    assert rung.status == "agree"
    assert "the picture does not vote: POV-Ray has no equal of the shape box under a texture" in (
        rung.reason
    )
    rung = heard(small("cornell_box", 32, 32))
    assert rung.status == "agree"
    assert "the picture does not vote: it is random" in rung.reason


def test_coincident_faces_are_left_to_exact_arithmetic():
    rung = heard(small("csg_coincident", 72, 54))
    hits = rung.numbers["first hits"]
    assert rung.status == "agree", rung.reason
    assert hits["coincident"] > 100, "POV-Ray leaves films"
    assert hits["wrong"] == 0


def _random_map(rng):
    """Any affine map, often one that mirrors."""
    while True:
        linear = rng.normal(size=(3, 3))
        values = np.linalg.svd(linear, compute_uv=False)
        if values[-1] > 0.3 * values[0]:
            return np.column_stack([linear / values[0], rng.uniform(-1.0, 1.0, 3)]).tolist()


def transformed(seed):
    """Every type of shape, and solids of them, under random maps, before a random camera."""
    rng = np.random.default_rng(seed)
    phong = rt.Phong(diffuse=(0.2, 0.1, 0.05), specular=0.1, exponent=9, ambient=(0.1, 0.1, 0.05))
    names = ("phong", "diffuse", "mirror")
    shapes = [
        rt.Sphere(center=(0.2, -0.1, 0.1), radius=0.7),
        rt.Box(),
        rt.Cylinder(radius=0.5, z_min=-0.6, z_max=0.7),
        rt.Cylinder(radius=0.6, capped=False),
        rt.Cone(radius=0.8, height=1.1, top_radius=0.3),
        rt.Cone(radius=0.8, height=1.1, capped=False),
        rt.Torus(major_radius=0.7, minor_radius=0.3),
        rt.Rectangle(),
        rt.Disk(),
        rt.Polygon(rings=(((0, 0), (1, 0.1), (1.1, 0.9), (0.2, 0.8)),)),
        rt.Quadric(
            coefficients=(1, 2, -0.5, 0.3, 0.2, -0.4, 0.1, 0, 0.2, -0.3),
            lower=(-1, -1, -1), upper=(1, 0.9, 1), capped=bool(seed % 2),
        ),
        rt.Mesh(
            vertices=((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
            faces=((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)),
        ),
        rt.Difference(of=(rt.Box(), rt.Sphere(center=(0.6, 0.7, 0.5), radius=0.8))),
        rt.Intersection(of=(rt.Sphere(), rt.Union(of=(rt.Box(transform=[{"translate": (1, 0, 0)}]),
                                                      rt.Torus(major_radius=0.6))))),
    ]  # fmt: skip
    placed = [
        shape.model_copy(
            update={
                "material": names[k % 3],
                "transform": (Matrix(matrix=_random_map(rng)),),
            }
        )
        for k, shape in enumerate(shapes)
    ]
    eye = 4.5 * affine.unit_vectors(rng, 1)[0]
    return rt.Scene(
        film=rt.Film(width=64, height=48),
        sampler=rt.Grid(),
        integrator=rt.Whitted(max_depth=4),
        camera=rt.Perspective(eye=tuple(eye), target=(0, 0, 0), fov=45),
        materials={"phong": phong, "diffuse": rt.Diffuse(), "mirror": rt.Mirror(reflectance=0.8)},
        shapes=tuple(placed),
        lights=(
            rt.Point(position=(3, 4, 2), intensity=(20, 22, 25)),
            rt.Directional(direction=(1, -2, -1), irradiance=(1, 0.9, 0.8)),
            rt.Ambient(radiance=0.5),
            rt.Constant(radiance=(0.2, 0.3, 0.5)),
        ),
    )


@pytest.mark.parametrize("seed", range(3))
def test_shapes_under_any_map(seed):
    rung = heard(transformed(seed))
    assert rung.status == "agree", rung.reason
    assert {"picture", "first hits"} <= set(rung.numbers), "both vote"


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3, 60))
def test_no_false_alarms_under_any_map(seed):
    rung = heard(transformed(seed))
    assert rung.status == "agree", rung.reason


ALL = sorted(path.stem for path in Path(SCENES).glob("*.yaml"))


@pytest.mark.slow
@pytest.mark.parametrize("name", ALL)
def test_all_scenes_from_other_places(name):
    """No scene differs, from 20 random places each: half a minute, in which POV-Ray starts."""
    scene = small(name, 40, 28)
    for seed in range(20):
        rng = np.random.default_rng([seed, *name.encode()])
        eye, target = np.array(scene.camera.eye), np.array(scene.camera.target)
        distance = np.linalg.norm(eye - target)
        place = target + (eye - target) + 0.3 * distance * affine.unit_vectors(rng, 1)[0]
        moved = scene.camera.model_copy(update={"eye": tuple(place.tolist())})
        rung = heard(scene.changed(camera=moved))
        assert rung.status in ("agree", "not-applicable"), (seed, rung.reason)


# ---- mistakes ------------------------------------------------------------------------------------

DIFFUSE = {"type": "phong", "ambient": [0.1, 0.12, 0.15], "diffuse": [0.2, 0.18, 0.15]}
MIRROR = {"type": "mirror", "reflectance": [0.7, 0.72, 0.75]}
SUN = {"type": "directional", "direction": [-1, -2, -1.2], "irradiance": 1.0}
AROUND = ({"type": "ambient", "radiance": 0.5}, {"type": "constant", "radiance": [0.2, 0.3, 0.5]})


def world(lights=(SUN, *AROUND), **changed):
    """A floor, a mirror, two shining balls, glass, and a box with a bite."""
    fields = {"exponent": 20.0, "half_vector": False, "specular": 0.2, "mirror": MIRROR}
    fields |= {"depth": 6, "ior": {"interior_ior": 1.5}, "bite": DIFFUSE, "floor": DIFFUSE}
    fields |= {"shine": {"ambient": [0.05, 0.1, 0.1], "diffuse": [0.05, 0.1, 0.15]}} | changed
    shine = {"type": "phong", **fields["shine"], "specular": fields["specular"]}
    shine |= {"exponent": fields["exponent"], "half_vector": fields["half_vector"]}
    balls = [
        {"type": "sphere", "material": m, "center": [x, 0.6, z], "radius": 0.6}
        for m, x, z in (("mirror", -1.5, -0.6), ("shine", 0.2, -1.2), ("glass", 0.35, 1.3))
    ]
    box = {
        "type": "difference",
        "material": "floor",
        "of": [
            {"type": "box", "transform": [{"scale": 0.7}]},
            {"type": "sphere", "material": "bite", "center": [-0.5, 0.5, 0.6], "radius": 0.6},
        ],
        "transform": [{"translate": [1.9, 0.71, -0.5]}],
    }
    floor = [{"scale": 6}, {"rotate": {"axis": [1, 0, 0], "degrees": -90}}]
    return Scene.parse(json.dumps({
        "camera": {"type": "perspective", "eye": [0.2, 2.4, 6.5], "target": [0.2, 0.5, 0],
                   "fov": 40},
        "film": {"width": 96, "height": 64},
        "sampler": {"type": "grid"},
        "integrator": {"type": "whitted", "max_depth": fields["depth"]},
        "materials": {"floor": fields["floor"], "shine": shine, "mirror": fields["mirror"],
                      "bite": fields["bite"], "glass": {"type": "dielectric", **fields["ior"]}},
        "shapes": [{"type": "rectangle", "material": "floor", "transform": floor}, *balls, box],
        "lights": list(lights),
    }))  # fmt: skip


def shown(**changed):
    return render(world(**changed)).colour


def times_the_cosine():
    """The highlight is what shine adds; a white surface in the sun alone shows the cosine."""
    matt = shown(specular=0.0)
    white = {"ambient": 0.0, "diffuse": 1.0}
    floor = {"type": "phong", **white}
    cosine = shown(lights=(SUN,), specular=0.0, shine=white, floor=floor, bite=floor)
    return matt + (shown() - matt) * cosine


MISTAKES = {
    "a subtracted operand's normal is not turned": lambda: shown(bite=DIFFUSE | {"diffuse": 0.0}),
    "Phong's exponent is halved": lambda: shown(exponent=10.0),
    "the highlight times the cosine": times_the_cosine,
    "ambient light is unweighted after a bounce": lambda: (
        shown(lights=(SUN, AROUND[1]))
        + shown(lights=AROUND[:1], mirror=MIRROR | {"reflectance": 1.0})
    ),
    "the indices of glass are exchanged": lambda: shown(
        ior={"interior_ior": 1.0, "exterior_ior": 1.5}
    ),
    "one reflection fewer": lambda: shown(depth=5),
    "no direct light after a bounce": lambda: shown(lights=(SUN,), depth=0) + shown(lights=AROUND),
    "Blinn's half vector for Phong's": lambda: shown(half_vector=True),
}
"""Pictures of `world` as they are with mistakes that two renderers may share."""


@pytest.fixture(scope="module")
def right():
    """`world`, its picture by POV-Ray, and its first hits."""
    scene = world()
    with POVRAY.load(scene, 2) as loaded:
        picture = loaded.render(1, 1).pictures[0]
    return scene, picture, POVRAY.first_hits(scene, 2)


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_that_two_share_are_seen(right, name):
    scene, theirs, _ = right
    wrong = MISTAKES[name]()
    vote = vote_of_picture((wrong, wrong, theirs), (OURS, MITSUBAS, THEIRS), scene)
    assert vote.status == "differ"
    assert vote.alone == THEIRS
    mine = vote_of_picture((wrong, shown(), theirs), (OURS, MITSUBAS, THEIRS), scene)
    assert (mine.status, mine.alone) == ("differ", OURS)


def test_the_right_picture_is_confirmed_and_a_wrong_one_of_mitsubas_stands_alone(right):
    scene, theirs, _ = right
    ours = shown()
    vote = vote_of_picture((ours, ours, theirs), (OURS, MITSUBAS, THEIRS), scene)
    assert (vote.status, vote.alone) == ("agree", "")
    wrong = MISTAKES["Phong's exponent is halved"]()
    vote = vote_of_picture((ours, wrong, theirs), (OURS, MITSUBAS, THEIRS), scene)
    assert (vote.status, vote.alone) == ("agree", MITSUBAS)
    # At the gate the candidate's edges may be sampled otherwise: it is judged by ours.
    vote = vote_of_picture((wrong, ours, theirs), ("candidate's", "reference_rt's", THEIRS), scene)
    assert (vote.status, vote.alone) == ("agree", "")


def _turned(hits):
    return replace(hits, n=np.where(hits.part[:, None] == 1, -hits.n, hits.n))


def _moved(hits):
    return replace(hits, p=hits.p * (1.0 + 2.0**-30), t=hits.t * (1.0 + 2.0**-30))


def _missed(hits):
    missed = hits.shape == 2
    return replace(hits, shape=np.where(missed, -1, hits.shape), t=np.where(missed, np.inf, hits.t))


@pytest.mark.parametrize("fault", [_turned, _moved, _missed])
def test_faults_of_first_hits_are_seen(right, monkeypatch, fault):
    scene, _, hits = right
    assert vote_of_hits(scene, hits, THEIRS).status == "agree"
    found = Scene.intersect
    monkeypatch.setattr(
        Scene, "intersect", lambda self, *given, **more: fault(found(self, *given, **more))
    )
    vote = vote_of_hits(scene, hits, THEIRS)
    assert vote.status == "differ"
    assert vote.numbers["wrong"] > 0


def test_a_witness_that_is_wrong_is_shown_to_be(right):
    scene, _, hits = right
    off = hits._replace(p=hits.p + 1e-6)
    vote = vote_of_hits(scene, off, THEIRS)
    assert vote.status == "differ"
    assert vote.numbers["wrong"] == 0
    assert vote.numbers["cleared"] > 100
    assert "POV-Ray's first hits are others" in vote.reason


# ---- commands ------------------------------------------------------------------------------------


def test_compare_and_gate_hear_it():
    scene = world().changed(film=rt.Film(width=24, height=16))
    budget = Budget(pixels=64, light_pixels=64, witness="povray")
    wrong = world(exponent=10.0).changed(film=rt.Film(width=24, height=16))
    case = compare_scene(Subject(wrong, wrong, scene), budget, lambda line: None, 2, ("whitted",))
    assert case.rungs[-1].name != "witness", "without pictures nobody is heard"
    only = ("statistics", "images")
    case = compare_scene(Subject(scene), budget, lambda line: None, 2, only)
    assert (case.verdict, case.rungs[-1].status) == ("agree", "agree"), case.reason
    assert list(case.images.others) == ["POV-Ray's"]
    case = compare_scene(Subject(wrong, wrong, scene), budget, lambda line: None, 2, only)
    assert case.verdict == "differ"
    assert "POV-Ray's stands alone" in case.reason


def test_the_gate_hears_it(tmp_path):
    from comparisons.gate.pictures_in import pictures_of
    from comparisons.gate.request import Request, gated

    scene = small("csg_die_lights", 36, 24, 4)
    case = gated(Request(scene, witness="povray"), pictures_of(render(scene).colour))
    assert case.verdict == "agree", case.reason
    assert case.rungs[-1].name == "witness"
    assert case.rungs[-1].status == "agree"


def test_replicates_repeat_the_picture():
    scene = small("csg_whitted", 24, 16, 4)
    assert POVRAY.version().startswith("3.7.")
    with POVRAY.load(scene, 1) as loaded:
        found = loaded.render(3, 4, seed=5)
    assert found.pictures.shape == (3, 16, 24, 3)
    assert found.pictures.dtype == np.float64
    assert (found.pictures == found.pictures[0]).all()
    assert (found.seconds > 0.0).all()
    assert found.spp == 4
    path = scene.changed(integrator=rt.Path(), sampler=rt.Sobol())
    with pytest.raises(NoCounterpartError, match="the integrator path"), POVRAY.load(path):
        pass


def test_who_has_noise_does_not_vote_without(monkeypatch):
    monkeypatch.setattr(type(other("cycles")), "version", lambda self: "5.0")
    hear = witness_of("cycles", world(), 0.005, 1, lambda line: None)
    rung, _ = hear((np.zeros((1, 4, 4, 3)),) * 2, (OURS, MITSUBAS))
    assert rung.status == "not-applicable"
    assert rung.reason == "Cycles has noise: it does not vote on pictures without"


def test_few_edges_are_explained_and_many_are_not():
    """Of a square of one colour other samples change edges alone."""
    square = rt.Scene(
        camera=rt.Orthographic(eye=(0.01, 0.02, 5), target=(0.01, 0.02, 0), up=(0.3, 1, 0)),
        film=rt.Film(width=64, height=64),
        sampler=rt.Grid(),
        integrator=rt.Whitted(),
        shapes=(rt.Rectangle(transform=[{"scale": 0.6}]),),
        lights=(rt.Directional(direction=(0, 0, -1), irradiance=3),),
    )
    ours = render(square).colour
    blurred = render(square.changed(sampler=rt.Grid(spp=16))).colour
    edges = np.argwhere((np.abs(blurred - ours) > 0.02).any(axis=-1))
    assert len(edges) > 100
    few = ours.copy()
    for y, x in edges[:: len(edges) // 3][:3]:
        few[y, x] = blurred[y, x]
    vote = vote_of_picture((ours, ours, few), (OURS, MITSUBAS, THEIRS), square)
    assert (vote.status, vote.numbers["on_edges"]) == ("agree", 3)
    vote = vote_of_picture((ours, ours, blurred), (OURS, MITSUBAS, THEIRS), square)
    assert (vote.status, vote.alone) == ("differ", THEIRS)
    few[32, 32] *= 1.002  # inside
    vote = vote_of_picture((ours, ours, few), (OURS, MITSUBAS, THEIRS), square)
    assert vote.status == "differ"
    assert "at x, y = (32, 32)" in vote.reason

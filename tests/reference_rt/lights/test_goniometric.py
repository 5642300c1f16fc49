"""Lamps with measured intensities: their values, flux and bounds by closed forms and by other
lamps."""

import math
from itertools import pairwise, product

import mpmath
import numpy as np
import pytest
from builders import random_turn, unit_vectors

import reference_rt as rt
from reference_rt.core.vec3 import Vec3
from reference_rt.lights.emitters import goniometric, spot
from reference_rt.util.errors import SceneError

U = 2.0**-53

ANGLES = 32 * U
"""How far rounding may turn a direction: unit vectors, three products, and angles up to 2 pi."""

PLACE = {"origin": (1.0, 2.0, -3.0), "target": (1.0, 1.0, -3.0)}
"""The axis is -y, C = 0 is +x."""

VERTICAL = (0.0, 10.0, 25.0, 60.0, 90.0, 140.0, 180.0)


def values(rows, seed=5):
    rng = np.random.default_rng(seed)
    found = rng.uniform(1.0, 9.0, (rows, len(VERTICAL)))
    found[:, 0], found[:, -1] = found[0, 0], found[0, -1]  # one direction has one intensity
    return found


def lamp(horizontal=None, table=None, vertical=VERTICAL, **fields):
    rows = values(len(horizontal or (0,))) if table is None else table
    given = {"vertical_angles": vertical, "horizontal_angles": horizontal, "values": rows}
    return rt.Goniometric(**{**PLACE, **given, **fields})


def towards(light, directions):
    """(n,): the table's value along directions (n, 3)."""
    table = light.tabulate()
    with np.errstate(all="ignore"):
        rows = np.atleast_2d(directions).tolist()
        return np.array([goniometric.value_towards(table, 0, Vec3(*d)) for d in rows])


def direction(gamma, c):
    """(n, 3): of angles in degrees, for PLACE, in the words of the standard: gamma from straight
    down, C counterclockwise seen from above, from +x (so that 90 degrees are -z)."""
    gamma, c = np.radians(gamma), np.radians(c)
    down, around = -np.cos(gamma), np.sin(gamma)
    return np.stack(np.broadcast_arrays(around * np.cos(c), down, -around * np.sin(c)), axis=-1)


def steepest(light):
    """The most that an intensity changes per radian across C or along gamma, for any direction
    that is ten degrees from the poles or more."""
    rows, across = np.asarray(light.values), np.radians(light.horizontal_angles or (0.0, 360.0))
    along = np.abs(np.diff(rows, axis=1) / np.diff(np.radians(light.vertical_angles))).max()
    around = np.abs(np.diff(rows, axis=0).T / np.diff(across)[: len(rows) - 1]).max(initial=0.0)
    return along + around / math.sin(math.radians(10.0))


# ---- where the table's numbers are ---------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_a_table_has_its_own_values_at_its_angles(seed):
    horizontal = (0.0, 20.0, 90.0, 170.0, 200.0, 300.0, 360.0)
    table = values(len(horizontal), seed)
    table[-1] = table[0]
    light = lamp(horizontal, table)
    for (k, c), (j, gamma) in product(enumerate(horizontal), enumerate(VERTICAL)):
        found = towards(light, direction(gamma, c))
        # Rounding may put 1e-16 beyond the last vertical angle, where a lamp is dark.
        assert found == pytest.approx(table[k, j], abs=9.0 * steepest(light) * ANGLES)


def test_between_its_angles_it_is_bilinear():
    light = lamp((0.0, 60.0, 180.0), [[1.0, 5.0], [2.0, 8.0], [4.0, 4.0]], (0.0, 40.0))
    quarter = 0.75 * 1.0 + 0.25 * 5.0, 0.75 * 2.0 + 0.25 * 8.0
    assert towards(light, direction(10.0, 0.0)) == pytest.approx(quarter[0], rel=1e-14)
    assert towards(light, direction(10.0, 15.0)) == pytest.approx(
        0.75 * quarter[0] + 0.25 * quarter[1], rel=1e-14
    )


def test_c_is_counterclockwise_seen_from_above():
    lobe = np.ones((5, len(VERTICAL)))
    lobe[1, 2:5] = 7.0
    light = lamp((0.0, 90.0, 180.0, 270.0, 360.0), lobe)
    sides = [(1, -0.5, 0), (0, -0.5, -1), (-1, -0.5, 0), (0, -0.5, 1)]  # C = 0, 90, 180, 270
    assert towards(light, np.array(sides)) == pytest.approx([1.0, 7.0, 1.0, 1.0], rel=1e-14)


def test_the_axis_and_what_is_beside_it():
    light = lamp((0.0, 60.0, 180.0))
    top, bottom = light.values[0][0], light.values[0][-1]
    assert towards(light, [0, -2.0, 0]) == top
    assert towards(light, [0, 2.0, 0]) == bottom
    # An angle from its cosine would be 0 here.
    thin = lamp(None, [[0.0, 1.0, 2.0]], (0.0, math.degrees(1e-9), 90.0))
    found = towards(thin, [2.5e-10, -1.0, 0.0])
    assert found == pytest.approx(0.25, rel=1e-14)


def test_nothing_happens_at_the_seam():
    horizontal = (0.0, 40.0, 90.0, 250.0, 330.0, 360.0)
    table = values(len(horizontal))
    table[-1] = table[0]
    light = lamp(horizontal, table)
    step = 1e-7
    for gamma in (20.0, 70.0, 100.0, 160.0):
        before, at, after = towards(light, direction(gamma, [-step, 0.0, step]))
        slope = steepest(light) * math.radians(step)
        assert abs(before - at) <= slope + 9.0 * ANGLES
        assert abs(after - at) <= slope + 9.0 * ANGLES
        tiny = np.nextafter(0.0, 1.0)
        sides = direction(gamma, 0.0) * [1, 1, 0] + [0, 0, 1] * np.array([[tiny], [-tiny]])
        assert towards(light, sides) == pytest.approx(at, rel=1e-13)


def test_it_is_dark_beyond_its_vertical_angles():
    light = lamp((0.0, 90.0), [[3.0, 2.0], [3.0, 1.0]], (30.0, 110.0))
    found = towards(light, direction(np.array([29.999, 30.001, 109.999, 110.001]), 200.0))
    assert (found > 0.0).tolist() == [False, True, True, False]
    table = light.tabulate()
    for gamma, pdf in ((20.0, 0.0), (40.0, 1.0)):
        p = np.array(PLACE["origin"]) + 2.0 * direction(gamma, 0.0)
        assert goniometric.sample(table, 0, Vec3(*p)).pdf == pdf


# ---- symmetric lamps -----------------------------------------------------------------------------


def folded(kind, c):
    """Where a lamp of a kind is measured for what it shines at C, from 0 to 360."""
    if kind == "same all around":
        return 0.0
    if kind == "both planes":
        return min(c % 180.0, 180.0 - c % 180.0)
    if kind == "plane of 0":
        return min(c, 360.0 - c)
    return c if 90.0 <= c <= 270.0 else (180.0 - c) % 360.0


KINDS = {
    "same all around": (0.0,),
    "both planes": (0.0, 15.0, 40.0, 90.0),
    "plane of 0": (0.0, 15.0, 40.0, 90.0, 150.0, 180.0),
    "plane of 90": (90.0, 100.0, 150.0, 180.0, 220.0, 270.0),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_symmetric_lamp_is_the_one_that_is_written_out(kind):
    own = KINDS[kind]
    table = values(len(own))
    # All angles at which the whole lamp has a row: those that fold to one of its own.
    everywhere = [c for c in np.arange(0.0, 360.1, 5.0).tolist() if folded(kind, c) in own]
    whole = everywhere if len(own) > 1 else [0.0, 360.0]
    rows = [table[own.index(folded(kind, c))] for c in whole]
    one, other = lamp(own, table), lamp(whole, rows)
    w = unit_vectors(np.random.default_rng(7), 400)
    assert np.array_equal(towards(one, w), towards(other, w))
    assert goniometric.power(one.tabulate(), 1.0) == goniometric.power(other.tabulate(), 1.0)


def test_a_lamp_about_the_plane_of_90_needs_no_row_at_180():
    with_it = KINDS["plane of 90"]
    table = values(len(with_it))
    table[3] = (4 * table[2] + 3 * table[4]) / 7.0  # linear from 150 to 220
    without = [k for k, c in enumerate(with_it) if c != 180.0]
    one = lamp(with_it, table)
    other = lamp([with_it[k] for k in without], table[without])
    w = unit_vectors(np.random.default_rng(8), 400)
    assert towards(one, w) == pytest.approx(towards(other, w), rel=1e-13)


# ---- other lamps, other places -------------------------------------------------------------------


def test_fine_cosines_are_a_lambertian_lamp():
    """Linear between angles h apart, it is off by h² / 8 of the second derivative at most."""
    degrees = np.linspace(0.0, 90.0, 361)
    light = lamp(None, [5.0 * np.abs(np.cos(np.radians(degrees)))], tuple(degrees))
    w = unit_vectors(np.random.default_rng(3), 500)
    bound = 5.0 * math.radians(0.25) ** 2 / 8.0 + 5.0 * ANGLES
    assert np.abs(towards(light, w) - 5.0 * np.maximum(-w[:, 1], 0.0)).max() <= bound
    # pi I, less the same.
    assert goniometric.power(light.tabulate(), 1.0) == pytest.approx(5.0 * math.pi, rel=1e-5)


@pytest.mark.parametrize(("beam", "cutoff"), [(10.0, 40.0), (90.0, 179.0), (1e-3, 2e-3)])
def test_a_spots_falloff_as_a_table_is_the_spot(beam, cutoff):
    """Also where no axis is the lamp's, and its power."""
    place = {"origin": (1.0, 2.0, -3.0), "target": (1.4, 1.0, -3.3), "intensity": (3.0, 2.0, 1.0)}
    one = rt.Spot(**place, beam_width=beam, cutoff_angle=cutoff).tabulate()
    light = lamp(None, [[1.0, 1.0, 0.0]], (0.0, beam, cutoff), **place, c0=(0.3, 1.0, 2.0))
    other = light.tabulate()
    rng = np.random.default_rng(11)
    axis = np.subtract(place["target"], place["origin"])
    for _ in range(300):
        spread = math.tan(min(math.radians(cutoff), 1.5)) * rng.normal(size=3)
        p = Vec3(*(np.array(place["origin"]) + axis + np.linalg.norm(axis) * spread))
        expected, found = spot.sample(one, 0, None, p), goniometric.sample(other, 0, p)
        full = 3.0 / np.sum(np.subtract(p, place["origin"]) ** 2)
        bound = full * (16 * U + ANGLES / math.radians(cutoff - beam))
        assert np.abs(np.subtract(expected.radiance, found.radiance)).max() <= bound
        assert (expected.wi, expected.distance) == (found.wi, found.distance)
    expected = spot.power(one, 1.0)
    assert goniometric.power(other, 1.0) == pytest.approx(expected, rel=1e-12, abs=32 * U)


def test_a_spots_picture():
    scene = rt.Scene.parse(FLOOR)
    place = {"origin": (0.3, 2.0, 0.2), "target": (0.0, 0.0, 0.0), "intensity": (9.0, 5.0, 3.0)}
    light = lamp(None, [[1.0, 1.0, 0.0]], (0.0, 15.0, 40.0), **place)
    expected = scene.changed(lights=(rt.Spot(**place, beam_width=15.0, cutoff_angle=40.0),))
    one, other = (rt.render(s).colour for s in (expected, scene.changed(lights=(light,))))
    assert one.max() > 0.3
    # As above: rounding of an angle over the width of the rim.
    assert np.abs(one - other).max() <= one.max() * (64 * U + ANGLES / math.radians(25.0))


FLOOR = """
camera: {type: perspective, eye: [0, 3, 3], target: [0, 0, 0]}
film: {width: 32, height: 24}
integrator: {type: whitted}
shapes: [{type: rectangle, transform: [{scale: 3}, {rotate: {axis: [1, 0, 0], degrees: -90}}]}]
"""


@pytest.mark.parametrize("kind", [*KINDS, "none"])
def test_lamps_turn_and_move_with_their_world(kind):
    rng = np.random.default_rng(12)
    light = lamp(KINDS.get(kind, (0.0, 45.0, 200.0, 300.0, 360.0)))
    w = unit_vectors(rng, 200)
    w = w[np.abs(w[:, 1]) < math.cos(math.radians(10.0))]
    expected = towards(light, w)
    for _ in range(3):
        turn, move = random_turn(rng), rng.normal(size=3)
        there = {"origin": turn @ PLACE["origin"] + move, "target": turn @ PLACE["target"] + move}
        moved = light.model_copy(update={"c0": tuple(turn @ (1.0, 0.4, 0.0))} | there)
        # The axis is a difference of places some ten times as long, each rounded.
        bound = steepest(light) * (ANGLES + 40 * U)
        assert np.abs(towards(moved, w @ turn.T) - expected).max() <= bound


def test_a_picture_turns_with_the_world():
    """A mirror of C would be the same picture of the wrong lamp in the unturned world alone."""
    scene = rt.Scene.parse(FLOOR)
    light = lamp(
        (0.0, 70.0, 200.0, 300.0, 360.0),
        values(5)[[0, 1, 2, 3, 0]],
        origin=(0.3, 1.5, 0.2),
        target=(0.0, 0.0, 0.1),
    )
    turned = rt.Scene.parse(
        FLOOR.replace("eye: [0, 3, 3], target", "eye: [0, -3, 3], up: [0, 0, 1], target").replace(
            ", {rotate: {axis: [1, 0, 0], degrees: -90}}", ""
        )
    )
    there = {k: (x, -z, y) for k in ("origin", "target") for x, y, z in [getattr(light, k)]}
    x, y, z = light.c0
    other = light.model_copy(update=there | {"c0": (x, -z, y)})
    one = rt.render(scene.changed(lights=(light,))).colour
    two = rt.render(turned.changed(lights=(other,))).colour
    # Rounding of hits, 16 of an ulp of some units, moves light by its slope: 1e-12 is far above.
    assert one.max() > 0.3
    assert np.abs(one - two).max() <= 1e-12 * one.max()


# ---- power and bounds ----------------------------------------------------------------------------


def exact_flux(light):
    """The integral over the sphere with 40 digits, by the primitive of (a + b gamma) sin gamma."""
    mpmath.mp.dps = 40
    degree = mpmath.pi / 180
    horizontal = list(light.horizontal_angles or (0.0,))
    rows = [[mpmath.mpf(float(x)) for x in row] for row in light.values]
    if len(horizontal) == 1:
        horizontal, rows = [0.0, 360.0], [rows[0], rows[0]]
    times = 360 / (horizontal[-1] - horizontal[0])  # so often does a symmetric lamp repeat
    total = mpmath.mpf(0)
    for (c, one), (d, other) in pairwise(zip(horizontal, rows, strict=True)):
        ring = [
            (x + y) / 2 * (mpmath.mpf(d) - mpmath.mpf(c)) * degree
            for x, y in zip(one, other, strict=True)
        ]
        angles = [mpmath.mpf(float(x)) * degree for x in light.vertical_angles]
        for (g, x), (h, y) in pairwise(zip(angles, ring, strict=True)):
            slope = (y - x) / (h - g)
            total += x * mpmath.cos(g) - y * mpmath.cos(h)
            total += slope * (mpmath.sin(h) - mpmath.sin(g))
    return float(times * total)


@pytest.mark.parametrize("horizontal", [*KINDS.values(), (0.0, 10.0, 200.0, 300.0, 360.0)])
def test_power_is_the_integral_of_the_table(horizontal):
    light = lamp(horizontal, intensity=(3.0, 2.0, 1.0))
    brightness = 0.2126 * 3.0 + 0.7152 * 2.0 + 0.0722
    expected = exact_flux(light) * brightness
    assert goniometric.power(light.tabulate(), 9.0) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("steps", [3, 300, 3000])
def test_power_of_fine_tables_keeps_its_digits(steps):
    """Of thin rings the terms of the primitive cancel."""
    degrees = np.linspace(0.0, 180.0, steps)
    light = lamp(None, [1.0 + np.arange(steps) % 3], tuple(degrees))
    found = goniometric.power(light.tabulate(), 1.0)
    assert found == pytest.approx(exact_flux(light), rel=1e-13)


def test_values_are_those_that_are_integrated():
    """By the midpoint rule of the kernel itself: a step of 0.5 degrees leaves 1e-4."""
    light = lamp(KINDS["plane of 90"])
    gamma = np.arange(0.25, 180.0, 0.5)
    c = np.arange(2.5, 360.0, 5.0)
    w = direction(gamma[:, None], c[None, :]).reshape(-1, 3)
    found = towards(light, w).reshape(len(gamma), len(c)).mean(axis=1)
    total = np.sum(found * np.sin(np.radians(gamma))) * math.radians(0.5) * 2.0 * math.pi
    assert goniometric.power(light.tabulate(), 1.0) == pytest.approx(total, rel=3e-4)


@pytest.mark.parametrize(
    ("table", "vertical", "axis", "reach"),
    [
        ([5.0, 2.0, 0.0, 0.0], (0.0, 20.0, 50.0, 90.0), -1.0, 50.0),
        ([0.0, 0.0, 1.0, 3.0], (0.0, 100.0, 130.0, 180.0), 1.0, 80.0),
        ([0.0, 1.0, 0.0], (0.0, 100.0, 120.0), -1.0, 120.0),
        ([4.0, 1.0], (60.0, 90.0), -1.0, 90.0),
        ([0.0, 0.0], (60.0, 90.0), -1.0, 0.0),
    ],
)
def test_the_cone_of_its_light(table, vertical, axis, reach):
    light = lamp(None, [table], vertical, intensity=2.0)
    found = goniometric.bounds(light.tabulate())
    assert found.axis[0] == pytest.approx([0.0, axis, 0.0], abs=U)
    assert found.reach[0] == pytest.approx(math.radians(reach), rel=4 * U)
    assert found.even[0] == pytest.approx(2.0 * max(table))
    w = unit_vectors(np.random.default_rng(2), 500)
    shining = towards(light, w)
    inside = np.arccos(np.clip(w @ found.axis[0], -1.0, 1.0)) <= found.reach[0] + 1e-7
    assert inside[shining > 0.0].all()
    assert (shining <= max(table) * (1.0 + 4 * U)).all()


def test_lamps_keep_to_their_own_tables():
    some = [lamp(own, values(len(own), 40 + k)) for k, own in enumerate(KINDS.values())]
    some.append(lamp(None, [[1.0, 2.0]], (10.0, 50.0)))
    table = goniometric.join([one.tabulate() for one in some])
    w = unit_vectors(np.random.default_rng(4), 100)
    for i, light in enumerate(some):
        found = [goniometric.value_towards(table, i, Vec3(*d)) for d in w.tolist()]
        assert np.array_equal(found, towards(light, w))
    powers = [goniometric.power(one.tabulate(), 1.0)[0] for one in some]
    assert np.array_equal(goniometric.power(table, 1.0), powers)


def test_a_tree_of_lamps_picks_each_that_shines():
    """Of forty lamps, most of which are dark at a point: the mean of what is picked, over its
    probability, is the sum of all, within five standard errors."""
    rng, lamps = np.random.default_rng(20), []
    for k in range(40):
        own = list(KINDS.values())[k % 4]
        table = values(len(own), k) * (np.arange(len(VERTICAL)) < 1 + k % 4)
        table = table[:, ::-1] if k % 3 == 0 else table
        place = rng.uniform(-3.0, 3.0, (2, 3))
        lamps.append(lamp(own, table, origin=tuple(place[0]), target=tuple(place[1])))
    scene = rt.Scene(lights=tuple(lamps))
    assert scene.tables.lights.tree is not None
    for p in rng.uniform(-3.0, 3.0, (4, 3)):
        alone = [rt.Scene(lights=(one,)).sample_lights(p[None], [[0.5] * 3]) for one in lamps]
        expected = sum(one.radiance[0, 0] for one in alone if one.pdf[0] > 0.0)
        assert any(one.pdf[0] == 0.0 for one in alone)
        found = scene.sample_lights(np.tile(p, (20000, 1)), rng.random((20000, 3)))
        share = np.divide(
            found.radiance[:, 0], found.pdf, out=np.zeros(20000), where=found.pdf > 0.0
        )
        error = share.std(ddof=1) / math.sqrt(len(share))
        assert error < 0.05 * expected
        assert abs(share.mean() - expected) <= 5.0 * error


# ---- files and wrong descriptions ----------------------------------------------------------------

PHOTOMETRY = "any words\nTILT=NONE\n1 1000 0.5 3 2 1 1 {} 1 1 60\n0 45 90\n0 180\n4 2 0 6 2 1\n"
OPENING = "0 0 0"


def scene_with(folder, text, **fields):
    (folder / "a.ies").write_text(text)
    path = folder / "scene.yaml"
    light = {"type": "goniometric", **PLACE, "file": "a.ies", **fields}
    path.write_text(
        f"shapes: [{{type: sphere}}]\nlights:\n  - {light}\n".replace("(", "[").replace(")", "]")
    )
    return rt.Scene.load(path)


def test_a_file_is_its_table(tmp_path):
    scene = scene_with(tmp_path, PHOTOMETRY.format(OPENING))
    found = scene.tables.lights.goniometrics
    same = lamp((0.0, 180.0), [[2.0, 1.0, 0.0], [3.0, 1.0, 0.5]], (0.0, 45.0, 90.0)).tabulate()
    assert all(np.array_equal(a, b) for a, b in zip(found, same, strict=True))


@pytest.mark.filterwarnings("error")
def test_what_a_file_has_beside_its_table_is_told(tmp_path):
    _ = scene_with(tmp_path, PHOTOMETRY.format(OPENING)).tables
    with pytest.warns(
        rt.SceneWarning, match=r"scene.yaml:3.*lights\[0\]\.file.*opening of 0.6"
    ) as told:
        _ = scene_with(tmp_path, PHOTOMETRY.format("2 1 0")).tables
    assert len(told) == 1
    tilted = PHOTOMETRY.format(OPENING).replace("NONE", "INCLUDE\n1 3\n0 45 90\n1 0.9 0.8")
    with pytest.warns(rt.SceneWarning, match="left out its factors of tilt"):
        _ = scene_with(tmp_path, tilted).tables


def test_wrong_files_are_told_together(tmp_path):
    text = "shapes: [{type: sphere}]\nlights:\n"
    text += "  - {type: environment_map, file: none.exr}\n"
    for name in ("one", "two"):
        text += (
            f"  - {{type: goniometric, origin: [0, 1, 0], target: [0, 0, 0], file: {name}.ies}}\n"
        )
    (tmp_path / "scene.yaml").write_text(text)
    with pytest.raises(SceneError) as told:
        _ = rt.Scene.load(tmp_path / "scene.yaml").tables
    assert "none.exr" in str(told.value)
    others = [str(one) for one in told.value.others]
    missing = "cannot be read: No such file or directory; expected an LM-63 file (.ies)"
    for k, name in ((1, "one"), (2, "two")):
        assert f"scene.yaml:{3 + k}: lights[{k}]: {tmp_path}/{name}.ies: {missing}" in others[k - 1]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"target": PLACE["origin"]}, "give no direction; expected two different points"),
        ({"c0": (0.0, 3.0, 0.0)}, "c0 is parallel to the light's axis; expected another"),
        ({"c0": (0.0, 0.0, 0.0)}, "c0: expected a direction"),
        ({"file": "a.ies"}, "has a file and a table; expected one of them"),
        ({"values": None}, "has no table; expected a file, or vertical_angles and values"),
        ({"vertical_angles": None}, "has no table; expected a file"),
        ({"values": ((1.0, 2.0),)}, "1 rows of 2 numbers; expected 2 of 3, a row for each"),
        ({"values": ((1.0, 2.0, 3.0),) * 3}, "3 rows of 3 numbers; expected 2 of 3"),
        ({"values": ()}, "values: expected rows of numbers, one for each horizontal angle"),
        ({"values": ((1.0, 2.0, -3.0),) * 2}, "values: has a negative number; expected"),
        ({"values": ((1.0, 2.0, math.nan),) * 2}, "expected a finite number"),
        ({"values": ((1.0, 2.0, math.inf),) * 2}, "expected a finite number"),
        ({"values": ((1.0, 2.0, "3"),) * 2}, "values"),
        (
            {"vertical_angles": (0.0, 20.0, 20.0)},
            "vertical_angles: vertical angle 20 follows 20; expected ascend",
        ),
        ({"vertical_angles": (-1.0, 20.0, 40.0)}, "vertical angle -1; expected angles from 0 to"),
        ({"vertical_angles": (0.0, 20.0, 181.0)}, "vertical angle 181; expected angles from 0"),
        ({"vertical_angles": (5.0,)}, "1 vertical angles; expected two or more"),
        ({"horizontal_angles": (0.0, 100.0)}, "horizontal angles from 0 to 100; expected 0 alone"),
        ({"horizontal_angles": (10.0, 90.0)}, "horizontal angles from 10 to 90; expected 0 alone"),
        ({"horizontal_angles": ()}, "no horizontal angle; expected one or more"),
        ({"horizontal_angles": (90.0, 0.0)}, "horizontal angle 0 follows 90"),
        ({"intensity": (1.0, -1.0, 1.0)}, "intensity: expected numbers of at least 0"),
    ],
)
def test_wrong_descriptions(fields, message):
    table = {
        **PLACE,
        "vertical_angles": (0.0, 20.0, 90.0),
        "horizontal_angles": (0.0, 90.0),
        "values": ((1.0, 2.0, 3.0),) * 2,
    }
    rt.Goniometric(**table)
    with pytest.raises(SceneError) as told:
        rt.Goniometric(**table | fields)
    assert message in str(told.value)

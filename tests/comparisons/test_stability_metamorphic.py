"""F9: transformed scenes look the same, and a tracer to which they do not is seen.  F14: the same
bits, and a renderer that lacks them is seen."""

import itertools

import numpy as np
import pytest

import reference_rt as rt
from comparisons.stability import (
    f09_light,
    f09_metamorphic,
    f09_rays,
    f09_scenes,
    f14_bits,
    f14_parts,
)
from comparisons.stability.families import family
from comparisons.stability.family import MITSUBA, OURS, Draw, Outcome, generator

EPSILON = 1e-4
"""What an absolute ray epsilon is."""


@pytest.fixture(autouse=True)
def _nothing_remembered():
    f09_light.remembered.cache_clear()
    yield
    f09_light.remembered.cache_clear()


def draw(folder, cases=150, mitsuba=False, effort="quick"):
    return Draw(np.random.default_rng(5), cases, mitsuba, folder, effort)


def measured(name, series, x, folder, **parts):
    return family(name).by_name[series].measure(draw(folder, **parts), x)


RAYS = [("translated", 1e4), ("translated", 1e12), ("shrunk", 1e9), ("grown", 1e12)]
RAYS += [("translated solids", 1.0), ("rearranged", 1.0), ("rearranged", 3.0), ("nested", 2.0)]


@pytest.mark.parametrize(("series", "x"), RAYS)
def test_rays_hit_the_same(series, x, tmp_path):
    found = measured("F9", series, x, tmp_path)[OURS]
    assert found.cases >= 150
    assert found.failures == 0, found.examples


@pytest.mark.parametrize("series", ["translated light", "shrunk light", "grown light"])
def test_pictures_are_the_same(series, tmp_path):
    found = measured("F9", series, 1e3, tmp_path)[OURS]
    assert found.cases == 2 * f09_scenes.FILM.width * f09_scenes.FILM.height
    assert found.failures == 0, found.examples


@pytest.mark.parametrize("x", [1.0, 160.0])
def test_powers_of_two_keep_every_bit(x, tmp_path):
    found = measured("F9", "powers of two", x, tmp_path)[OURS]
    assert found.failures == 0, found.examples
    assert found.worst == 0.0


@pytest.mark.parametrize("x", [0.0, 1.0, 2.0, 3.0])
def test_turns_and_mirrors(x, tmp_path):
    found = measured("F9", "turned", x, tmp_path, cases=210)[OURS]
    assert found.failures == 0, found.examples


# ---- faults that must be seen -------------------------------------------------------------------


def test_an_epsilon_is_seen_by_rays(tmp_path, monkeypatch):
    """Hits closer than 1e-4 passed over, as where t_min is a constant."""
    honest = f09_rays.ours

    def with_epsilon(tables, o, d):
        found = honest(tables, o, d)
        near = found.t < EPSILON
        identities = np.where(near[:, None], -1, found.identities)
        return f09_rays.Found(np.where(near, np.inf, found.t), identities)

    monkeypatch.setattr(f09_rays, "ours", with_epsilon)
    assert measured("F9", "shrunk", 1e3, tmp_path, cases=30)[OURS].failures == 0
    assert measured("F9", "shrunk", 1e6, tmp_path, cases=30)[OURS].failures > 50


def test_an_epsilon_is_seen_in_pictures(tmp_path, monkeypatch):
    """The eye moved by a constant: what an offset of a shadow ray does to the point it leaves."""
    honest = f09_light.colours

    def with_epsilon(contestant, scene):
        eye = tuple(x + EPSILON for x in scene.camera.eye)
        camera = scene.camera.model_copy(update={"eye": eye})
        return honest(contestant, scene.changed(camera=camera))

    monkeypatch.setattr(f09_light, "colours", with_epsilon)
    assert measured("F9", "shrunk light", 10.0, tmp_path)[OURS].failures > 500


def test_rounded_arithmetic_is_seen(tmp_path, monkeypatch):
    """t to float32: bits are lost where they must stay, and edges move."""
    honest = f09_rays.ours

    def rounded(tables, o, d):
        return honest(tables, f09_rays.round32(o), d)

    monkeypatch.setattr(f09_rays, "ours", rounded)
    assert measured("F9", "translated", 1e8, tmp_path)[OURS].failures > 100


def test_exact_arithmetic_judges_both_answers(tmp_path):
    """A name exchanged for another is wrong, whatever rounding may do."""
    bench = f09_rays.Bench(f09_scenes.things(tmp_path), 60, np.random.default_rng(1))
    wrong = bench.ours.found.identities.copy()
    wrong[:, 3] += 1
    after = bench.ours._replace(found=f09_rays.Found(bench.ours.found.t, wrong))
    outcome = f09_rays.judged(bench.ours, after, 1.0, exact=False)
    hits = np.count_nonzero(np.isfinite(bench.ours.found.t))
    # Of two triangles beside an edge both may be right.
    assert outcome.failures + outcome.open >= hits - 3
    assert hits > 40


def test_edges_are_found(tmp_path):
    """Two thirds of the rays pass an edge closely: a move of theirs changes what they hit."""
    scene = f09_scenes.things(tmp_path)
    tables = rt.build_tables(scene)
    rays = f09_rays.aimed(tables, 600, np.random.default_rng(2))
    first = f09_rays.ours(tables, rays.o, rays.d)
    changed = np.zeros(len(rays.o), bool)
    for move in itertools.product((-1e-3, 0.0, 1e-3), repeat=3):
        changed |= f09_rays.differ(first, f09_rays.ours(tables, rays.o, rays.d + move))
    fine = ~rays.coarse
    assert fine.sum() > 100
    assert changed[fine].mean() > 0.9


# ---- Mitsuba ------------------------------------------------------------------------------------


def test_mitsuba_takes_part(tmp_path):
    """Its float32 holds what is near, and not what is far."""
    near = measured("F9", "translated", 1.0, tmp_path, mitsuba=True)[MITSUBA]
    far = measured("F9", "translated", 1e8, tmp_path, mitsuba=True)[MITSUBA]
    assert near.failures <= 2
    assert far.failures > near.cases // 2


@pytest.mark.slow
def test_mitsubas_epsilon_shows(tmp_path):
    """Shadows of a scene a thousand times smaller."""
    found = measured("F9", "shrunk light", 1e3, tmp_path, mitsuba=True)
    assert found[OURS].failures == 0
    assert found[MITSUBA].failures > 100


# ---- F14 ----------------------------------------------------------------------------------------

SAME = [("threads", 4.0), ("wide filter, scalar", 3.0), ("bands", 7.0)]
SAME += [pytest.param("interrupted", 1.0, marks=pytest.mark.slow)]


@pytest.mark.parametrize(("series", "x"), SAME)
def test_the_same_bits(series, x, tmp_path):
    found = measured("F14", series, x, tmp_path)[OURS]
    assert found.failures == 0, found.examples


@pytest.mark.slow
@pytest.mark.parametrize("x", [8.0, 256.0])
def test_the_same_bits_in_plain_python(x, tmp_path):
    found = measured("F14", "blocks in plain Python", x, tmp_path)[OURS]
    assert found.cases == 2 * 48
    assert found.failures == 0, found.examples


def test_sums_in_another_order_are_seen(tmp_path, monkeypatch):
    """A band that leaves the last bits to chance."""
    honest = f14_parts._band

    def careless(*arguments):
        honest(*arguments)
        out, begin = arguments[7], arguments[9]
        out[begin] = np.nextafter(out[begin], np.inf)

    monkeypatch.setattr(f14_parts, "_band", careless)
    assert measured("F14", "bands", 64.0, tmp_path)[OURS].failures > 20


def test_same_bits():
    one = np.ones((2, 3, 3))
    other = one.copy()
    other[1, 2, 0] = np.nextafter(1.0, 2.0)
    assert f14_bits.same_bits(one, one) == Outcome(6, 0, 0.0)
    found = f14_bits.same_bits(one, other)
    assert (found.failures, found.examples[0]["pixel"]) == (1, [2, 1])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["F9", "F14"])
def test_everything(name, tmp_path):
    """All settings, without Mitsuba, within what each series holds to."""
    for series in family(name).series:
        for x in series.values:
            rng = generator(0, name, series.name, x)
            folder = tmp_path / f"{series.name} {x:g}"
            folder.mkdir()
            cases = series.cases["quick"]
            found = series.measure(Draw(rng, cases, False, folder, "full"), x)[OURS]
            assert x > series.holds_to or found.failures == 0, (series.name, x, found.examples)


def test_offsets_are_exact():
    """As far as the family says that they are."""
    moved = f09_metamorphic.offset(f09_metamorphic.EXACT_TO)
    p = (7.984375, -7.984375, 0.015625)
    far = moved.point(p)
    assert tuple(a - b for a, b in zip(far, moved.offset, strict=True)) == p

"""F2 and F13: the families hold for ours, and see what is planted."""

import numpy as np
import pytest

from comparisons.experiments.stability import leaving
from comparisons.experiments.stability.contact.light import fresnel
from comparisons.experiments.stability.contact.stacks import FAR, plates
from comparisons.experiments.stability.harness.outcomes import OURS
from comparisons.experiments.stability.harness.series import Draw, family
from comparisons.experiments.stability.harness.shadows import bound
from comparisons.experiments.stability.leaving.departures import depart, subjects
from comparisons.experiments.stability.leaving.judge import Judge, Tally, row_of
from comparisons.experiments.stability.leaving.shapes import KINDS, Extent, aim, place
from comparisons.referee import first_hit

PLAIN = Extent.of(1.0, 2.0, 1.0, False)


def draw_of(folder, cases=300, seed=5):
    return Draw(np.random.default_rng(seed), cases, False, folder)


def planted(kind, fault, tmp_path):
    """What is reported when ours is changed by `fault`."""
    draw = draw_of(tmp_path)
    placed = place(kind, PLAIN, draw)
    (subject,) = subjects(kind, [placed])
    rays, ways = aim(placed, 200, False, draw.rng), leaving.ways(draw.rng, 200)
    tally = Tally()
    found = depart(subject, rays, ways)
    fault(found, ways.outer)
    Judge(placed, subject, sample=4)(tally, rays, ways.outer, found, True)
    return tally


def again(found, outer):
    found.again[np.flatnonzero(outer)[:3]] = 1e-12


def lost(found, outer):
    found.again[np.flatnonzero(~outer)[:3]] = np.inf


def far(found, _):
    found.start[:3] += found.n[:3] * 1e-6


def missed(found, _):
    found.t[:3] = np.inf


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "kinds", "why"),
    [
        (lambda *_: None, ("sphere", "rectangle", "torus", "box"), {}),
        (again, ("sphere", "rectangle"), {"met again": 3}),
        (lost, ("sphere", "box", "torus"), {"lost": 3}),
        (far, ("sphere",), {"begins too far off": 3}),
        (missed, ("sphere",), {"the shape is not met": 3}),
    ],
)
def test_faults_are_seen(fault, kinds, why, tmp_path):
    for kind in kinds:
        assert planted(kind, fault, tmp_path).why == why


@pytest.mark.slow
def test_a_start_on_the_wrong_side_is_seen_by_exact_arithmetic(tmp_path):
    """The tracer itself says nothing is wrong: the sample is asked about."""

    def beneath(found, outer):
        found.start[:] = np.where(outer[:, None], 2.0 * found.p - found.start, found.start)

    assert planted("sphere", beneath, tmp_path).why.get("met again", 0) > 0


@pytest.mark.parametrize("kind", sorted(set(KINDS) - {"mesh", "solid", "instance"}))
def test_aimed_rays_meet_the_shape(kind, tmp_path):
    """By exact arithmetic; what they are aimed at is inside."""
    draw = draw_of(tmp_path)
    placed = place(kind, PLAIN, draw)
    (subject,) = subjects(kind, [placed])
    rays = aim(placed, 50, False, draw.rng)
    assert np.isfinite(first_hit(subject.field, row_of(subject), rays.o, rays.d).t).all()


# ---- F13 ----------------------------------------------------------------------------------------


def test_gaps_below_the_law_are_lost_at_last(tmp_path):
    """Plates a thousand scales away, closer than floats there are: the family is not blind."""
    far = family("F13").by_name["plates, far away"]
    assert far.holds_to * 4.0 * bound(FAR, 1.0) < 1.0
    assert far.measure(draw_of(tmp_path, 80), 1e15)[OURS].failures > 0


def test_fresnel_head_on():
    assert fresnel(np.array([1.0]))[0] == pytest.approx(1.0 - 0.2**2, rel=1e-15)


def test_plates_are_as_far_apart_as_asked():
    stack = plates(np.random.default_rng(1), 4, 1e-3)
    centers = np.array([np.array(s.transform[0].matrix)[:, 3] for s in stack.scene.shapes])
    apart = np.linalg.norm(np.diff(centers, axis=0), axis=1)
    assert apart == pytest.approx(np.full(7, 1e-3), rel=1e-12)

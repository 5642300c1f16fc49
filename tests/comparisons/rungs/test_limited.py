"""A limit excuses single rays by their own geometry, pictures by what is left of them."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from comparisons.mitsuba.counterpart import trace
from comparisons.results.case import RungResult
from comparisons.rungs import direct
from comparisons.rungs.limited import Rest, limited
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.rays import Rays
from comparisons.rungs.rays.resolution import Resolution, beyond_precision, elsewhere
from comparisons.translator import load
from reference_rt.rendering import query
from reference_rt.rendering.query import DirectLight
from reference_rt.rendering.scene import Scene

COARSE = RungResult(
    "geometry",
    "agree",
    "",
    {"resolution": Resolution(1000, 50, 48, 0, 1e-3, 1e-6)._asdict(), "rays": 1000},
)
"""A rung in which 48 of 1000 points of surfaces are beyond precision."""

PICTURES = RungResult("images", "differ", "other")

RAYS = {"rays": 400, "explained": 3, "unexplained": 6, "lit": 300, "lit_right": 200, "elsewhere": 0}


def after(rung: RungResult, below: RungResult = COARSE, **given: Any) -> RungResult:
    return limited([rung, below], **given)[1]


# ---- single rays --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("numbers", "status"),
    [
        ({}, "reference-limited"),
        ({"elsewhere": 1}, "differ"),  # a ray that precision does not concern
        ({"tells": False}, "inconclusive"),  # most of what is lit says nothing
    ],
)
def test_rays_that_differ_must_each_be_beyond_precision(numbers: Any, status: str) -> None:
    found = after(RungResult("direct", "differ", "6 of 400", RAYS | numbers))
    assert found.status == status
    assert "6 of 400" in found.reason


def test_rays_of_which_it_is_not_known_differ() -> None:
    numbers = {name: n for name, n in RAYS.items() if name != "elsewhere"}
    assert after(RungResult("whitted", "differ", "", numbers)).status == "differ"


def test_nothing_is_excused_above_a_rung_that_differs_even_so() -> None:
    broken = RungResult("direct", "differ", "", RAYS | {"elsewhere": 1})
    found = limited([COARSE, broken, PICTURES], lambda share: Rest("agree", ""))
    assert [rung.status for rung in found] == ["agree", "differ", "differ"]


def test_a_rung_needs_values_that_agree() -> None:
    assert arbiter.is_enough(30, 300)
    assert not arbiter.is_enough(29, 300)


@pytest.mark.parametrize("status", ["agree", "reference-limited"])
def test_where_no_rung_says_anything_the_scene_is_open(status: Any) -> None:
    mute = RungResult("direct", status, "3 of 300", RAYS | {"tells": False})
    assert [rung.status for rung in limited([COARSE, mute])] == ["agree", "inconclusive"]
    heard = RungResult("whitted", "agree", "")
    found = limited([COARSE, mute, heard])
    assert [rung.status for rung in found] == ["agree", status, "agree"]


def test_a_bound_larger_than_the_values_tells_nothing() -> None:
    ours, theirs = np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 1.0]]), np.array([[2.0, 0, 0], [0, 0, 0]])
    assert arbiter.tells(np.array([1.0, 0.51]), ours, theirs).tolist() == [True, False]


# ---- pictures -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["statistics", "images"])
@pytest.mark.parametrize("status", ["agree", "differ", "inconclusive"])
def test_pictures_are_judged_by_what_is_left(name: str, status: Any) -> None:
    found = after(replace(PICTURES, name=name), rest_of=lambda share: Rest(status, "of the rest"))
    assert found.status == ("reference-limited" if status == "agree" else status)
    assert "of the rest" in found.reason
    assert ("from 50 of 1000 points by prediction" in found.reason) == (status == "agree")


def test_without_a_rest_pictures_differ() -> None:
    assert after(PICTURES).status == "differ"


def test_what_is_left_is_judged_once_and_by_the_limits_share() -> None:
    """The upper end of the interval of 48 of 1000, and of 40 of 400."""
    shares: list[float] = []

    def rest_of(share: float) -> Rest:
        shares.append(share)
        return Rest("agree", "")

    limited([COARSE, replace(PICTURES, name="statistics"), PICTURES], rest_of)
    numbers = {"pixels": 400, "explained": 40}
    limited([RungResult("whitted", "reference-limited", "", numbers), PICTURES], rest_of)
    assert len(shares) == 2
    assert 0.07 < shares[0] < 0.085
    assert 0.15 < shares[1] < 0.18
    few = RungResult("whitted", "agree", "", numbers | {"explained": 1})
    assert limited([few, PICTURES], rest_of)[1].status == "differ"
    assert len(shares) == 2


def test_the_largest_share_that_counts_allow() -> None:
    """Without a single one: (1 - p)^n is the chance of that."""
    assert arbiter.most_of(0, 100) == pytest.approx(1.0 - arbiter.SURE**0.01)
    assert arbiter.most_of(100, 100) == 1.0


# ---- which rays ---------------------------------------------------------------------------------

SLAB = """
camera: {{type: orthographic, eye: [0, 0, -3], target: [0, 0, 0], up: [0, 1, 0], width: 3.2}}
film: {{width: 16, height: 12}}
integrator: {{type: whitted}}
materials: {{grey: {{type: diffuse, reflectance: {reflectance}}}}}
shapes:
  - {{type: rectangle, material: grey,
     transform: [{{scale: [1, 2, 1]}}, {{translate: [-1, 0, 2e-5]}}]}}
  - {{type: rectangle, material: grey, transform: [{{scale: 2}}]}}
lights: [{{type: directional, direction: {direction}, irradiance: {irradiance}}}]
"""
"""Below a floor of which the left half has a slab above it, nearer than Mitsuba's ray epsilon."""


def slab(reflectance: float = 0.5, direction: str = "[0, 0.1, -1]", irradiance: float = 1) -> Scene:
    return Scene.parse(SLAB.format(**locals()))


def from_above(n: int = 200) -> Rays:
    """Onto the middle of the gap, from between floor and slab on the left, or above the right."""
    x = np.linspace(-1.5, 1.5, n)
    x = x[np.abs(x) > 0.1]
    start = np.column_stack([x, 0.3 + 0.0 * x, np.where(x < 0.0, 1e-5, 1.0)])
    return Rays(start, np.tile([0.0, 0.0, -1.0], (len(x), 1)))


def test_which_rays_are_beyond_precision_is_a_matter_of_geometry() -> None:
    """Those whose hits lie below the slab, whatever the light and the materials are."""
    scene, rays = slab(), from_above()
    found = beyond_precision(scene, scene.tables, load(scene), rays)
    below = rays.o[:, 0] < 0.0
    assert found[below].all()
    assert not found[~below].any()
    assert elsewhere(scene, scene.tables, load(scene), rays) == np.count_nonzero(~below)
    for other in (slab(reflectance=0.1), slab(irradiance=9.0), slab(direction="[0, 0.1, 1]")):
        again = beyond_precision(other, other.tables, load(scene), rays)
        np.testing.assert_array_equal(again, found)


SHEET = """
camera: {{type: orthographic, eye: [0, 0, -3], target: [0, 0, 0], up: [0, 1, 0], width: 1.6}}
film: {{width: 16, height: 12}}
integrator: {{type: path}}
materials:
  grey: {{type: diffuse}}
  glass: {{type: rough_dielectric}}
  m: {material}
shapes: [{{type: box, material: m, transform: [{{scale: [1, 1, 1e-5]}}]}}]
lights: [{{type: constant, radiance: 1}}]
"""
"""A sheet that is thinner than Mitsuba's ray epsilon, seen face on."""


@pytest.mark.parametrize(
    ("material", "passes"),
    [
        ("{type: diffuse}", False),
        ("{type: plastic}", False),
        ("{type: principled}", False),
        ("{type: two_sided, base: grey}", False),
        ("{type: dielectric}", True),
        ("{type: thin_dielectric}", True),
        ("{type: rough_dielectric, alpha: 0.3}", True),
        ("{type: principled, spec_trans: 0.5}", True),
        ("{type: principled_thin, diff_trans: 1}", True),
        ("{type: mask, base: grey}", True),
        ("{type: blend, first: grey, second: glass}", True),
        ("{type: emissive, radiance: 1, base: glass}", True),
    ],
)
def test_rays_that_pass_a_sheet_miss_its_other_side(material: str, passes: bool) -> None:
    """So that light which ours keeps inside goes on in Mitsuba; of what is opaque it does not."""
    scene = Scene.parse(SHEET.format(material=material))
    x, y = np.random.default_rng(5).uniform(-0.7, 0.7, (2, 40))
    rays = Rays(np.column_stack([x, y, x - x - 3.0]), np.tile([0.0, 0.0, 1.0], (40, 1)))
    assert (beyond_precision(scene, scene.tables, load(scene), rays) == passes).all()


# ---- a fault of light does not make its own excuse ----------------------------------------------

LIT = """
camera: {{type: perspective, eye: [0.4, -2, 5], target: [0, 0, 0.3], up: [0, 1, 0], fov: 35}}
film: {{width: 24, height: 18}}
shapes:
  - {{type: rectangle, transform: [{{scale: 3}}]}}
  - {{type: sphere, center: [0.3, 0.2, 0.6], radius: 0.4}}
lights: [{light}]
"""

LIGHTS = {
    "directional": (
        "{type: directional, direction: [-1, -0.5, -2], irradiance: 3}",
        "{type: directional, direction: [1, 0.5, 2], irradiance: 3}",
    ),
    "point": (
        "{type: point, position: [1, 1, 3], intensity: 9}",
        "{type: point, position: [1, 1, -3], intensity: 9}",
    ),
    "spot": (
        "{type: spot, origin: [1, 1, 3], target: [0, 0, 0], intensity: 9, cutoff_angle: 40}",
        "{type: spot, origin: [1, 1, 3], target: [2, 2, 6], intensity: 9, cutoff_angle: 40}",
    ),
}


@pytest.mark.parametrize("kind", LIGHTS)
def test_light_from_elsewhere_is_not_unresolved(kind: str) -> None:
    """Where ours is dark without a shadow, no shadow ray explains that Mitsuba's is lit."""
    right, wrong = (Scene.parse(LIT.format(light=light)) for light in LIGHTS[kind])
    assert direct(right, right.tables, load(right), 200).status == "agree"
    found = direct(wrong, wrong.tables, load(right), 200)
    assert found.status == "differ"
    assert found.numbers["explained"] <= 0.01 * found.numbers["rays"]
    assert found.numbers["elsewhere"] > 0.3 * found.numbers["unexplained"]


def decorated(
    monkeypatch: pytest.MonkeyPatch, change: Callable[[Rays, DirectLight], DirectLight]
) -> RungResult:
    """The rung of a scene in which our direct light is changed."""
    right = query.direct_light

    def faulty(tables: Any, o: Any, d: Any, *which: Any) -> DirectLight:
        return change(Rays(o, d), right(tables, o, d, *which))

    scene = Scene.parse(LIT.format(light=LIGHTS["point"][0]))
    counterpart = load(scene)
    monkeypatch.setattr(query, "direct_light", faulty)
    return direct(scene, scene.tables, counterpart, 200)


def test_a_renderer_without_shadows_does_not_explain_itself(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its light passes through the ball, by which our own shadow ray is blocked."""
    scene = Scene.parse(LIT.format(light=LIGHTS["point"][0]))
    away = scene.shapes[1].model_copy(update={"center": (0.0, 0.0, 1e3)})
    alone = scene.changed(shapes=(scene.shapes[0], away)).tables
    right = query.direct_light

    def without_shadows(rays: Rays, light: DirectLight) -> DirectLight:
        on_floor = scene.intersect(*rays).shape == 0
        lit = right(alone, *rays, 0, (0.5, 0.5)).contribution
        value = np.where(on_floor[:, None], lit, light.contribution)
        return replace(light, contribution=value)

    found = decorated(monkeypatch, without_shadows)
    assert found.status == "differ"
    assert found.numbers["unexplained"] > 5
    assert found.numbers["explained"] <= 0.01 * found.numbers["rays"]


def test_what_the_arbiter_explains_everywhere_is_no_edge(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every third ray of a call is black, whichever it is: rays next to them are right."""

    def black(rays: Rays, light: DirectLight) -> DirectLight:
        some = np.arange(len(rays.o))[:, None] % 3 == 0
        return replace(light, contribution=np.where(some, 0.0, light.contribution))

    found = decorated(monkeypatch, black)
    assert found.numbers["unexplained"] == 0
    assert found.status == "differ"
    assert "not beyond Mitsuba's precision" in found.reason
    assert limited([COARSE, found])[1].status == "differ"


PLANE = """
camera: {type: perspective, eye: [0, -5, 1], target: [0, 0, 0], up: [0, 0, 1], fov: 50}
film: {width: 8, height: 6}
shapes: [{type: plane}]
"""


def test_a_hit_beyond_a_plane_is_left_out_only_where_mitsuba_has_no_plane() -> None:
    """Our hits of a plane, all as far away as if they were beyond the mesh that stands in."""
    scene = Scene.parse(PLANE)
    counterpart = load(scene)
    o = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
    d = np.array([[0.0, 0.6, -0.8], [1.0, 0.0, -1e-9]])
    ours, theirs = scene.intersect(o, d), trace(counterpart, o, d)
    assert counterpart.beyond_planes(ours, theirs).tolist() == [False, True]
    ours.p[:] = 1e9
    assert counterpart.beyond_planes(ours, theirs).tolist() == [False, True]

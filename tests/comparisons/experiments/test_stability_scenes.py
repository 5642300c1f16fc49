"""The stiff scenes are right by closed forms, and Mitsuba's limits on them are told."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from stiff_scenes import scene

from comparisons.results.case import RungResult
from comparisons.rungs import direct
from comparisons.rungs.limited import Rest, limited
from comparisons.rungs.rays.camera import camera_rays
from comparisons.rungs.rays.resolution import Resolution, resolution
from comparisons.translator import load
from comparisons.translator.moved import frame_of, moved
from reference_rt.core.arrays import FloatArray
from reference_rt.core.transform import Scale
from reference_rt.integrators import Whitted
from reference_rt.rendering import query
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables


def camera_hits(
    of: Scene, x: FloatArray, y: FloatArray
) -> tuple[FloatArray, FloatArray, Intersections]:
    o, d = camera_rays(of, x, y)
    return o, d, of.intersect(o, d)


# ---- the scenes ---------------------------------------------------------------------------------


def test_the_planets_horizon_is_where_it_must_be() -> None:
    """From h above a sphere of radius R it dips by acos(R / (R + h)) below the horizontal."""
    planet = scene("planet")
    dip = np.arccos(1e6 / (1e6 + 1.0))
    angle = np.linspace(-1.02, -0.98, 41) * dip
    d = np.column_stack([np.full_like(angle, 0.9), np.sin(angle), -np.full_like(angle, 0.3)])
    d[:, [0, 2]] *= (np.cos(angle) / np.hypot(0.9, 0.3))[:, None]
    hits = planet.intersect(np.tile([0.0, 1.0, 0.0], (len(d), 1)), d)
    met = hits.shape == 0
    apart = np.abs(angle + dip) > 1e-12
    assert np.array_equal(met[apart], (angle < -dip)[apart])
    # The nearest ground straight below is 1 away.
    below = planet.intersect([[0.0, 1.0, 0.0]], [[0.0, -1.0, 0.0]])
    assert abs(below.t[0] - 1.0) < 1e-9


@pytest.mark.parametrize("name", ["far_origin", "tiny"])
def test_moved_scenes_show_what_they_show_where_they_are(name: str) -> None:
    there = scene(name)
    here = moved(there, frame_of(there))
    x, y = np.random.default_rng(3).uniform(0.0, [[144.0], [108.0]], (2, 4000))
    _, _, ours = camera_hits(there, x, y)
    _, _, theirs = camera_hits(here, x, y)
    other = (ours.shape != theirs.shape) | (ours.primitive != theirs.primitive)
    # Of rays within 1e-8 of an edge, where float64 has 1e-9 at 1e7: one in thousands.
    assert np.count_nonzero(other) <= 1
    scale = frame_of(there).scale
    assert np.allclose(ours.t[~other] * scale, theirs.t[~other], rtol=1e-7)


def test_the_lamps_light_does_not_leave_the_vase() -> None:
    """Every ray from within meets the vase before anything else, slivers or not."""
    slivers = scene("slivers")
    rng = np.random.default_rng(5)
    aimed = slivers.tables.geometry.shapes.triangles
    assert aimed is not None
    corners = aimed.vertices.reshape(-1, 3)[rng.integers(0, 3 * len(aimed.vertices), 6000)]
    d = np.concatenate([rng.normal(size=(6000, 3)), corners - [0.0, 0.5, 0.0]])
    o = np.tile([0.0, 0.5, 0.0], (len(d), 1)) + 0.06 * d / np.linalg.norm(d, axis=1)[:, None]
    assert (slivers.intersect(o, d).shape == 1).all()


def test_mirrorings_multiply() -> None:
    """Unfolded, the mirrors are planes at odd z: after k of them reflectance^k is left."""
    mirrors = scene("deep_mirrors")
    k = 400
    # So steep that it crosses k planes before it leaves them sideways; then the sky.
    o = np.array([[0.0, 0.9, 0.9]])  # above the frame
    d = np.array([[1.25 / (2.0 * k), 0.0, -1.0]])
    d /= np.linalg.norm(d)
    slope = d[0, 0] / -d[0, 2]
    count = int(np.ceil((1.25 / slope - 1.9) / 2.0))
    tables = build_tables(mirrors)
    deep = Whitted(max_depth=1000, min_contribution=0.0)
    found = query.radiance_without_noise(tables, deep.setup(), o, d)[0]
    expected = np.array([0.02, 0.025, 0.04]) * np.array([0.995, 0.98, 0.95]) ** count
    assert np.allclose(found, expected, rtol=1e-11)


def test_cells_look_alike_over_twelve_decades() -> None:
    cells = scene("bright_and_dim")
    o = np.column_stack([np.arange(-6.0, 7.0) + 0.1, np.full(13, -0.3), np.full(13, 5.0)])
    d = np.tile([0.0, 0.0, -1.0], (13, 1))
    found = query.radiance_without_noise(build_tables(cells), Whitted().setup(), o, d)
    assert (found > 0.01).all()
    assert np.allclose(found, found[0], rtol=1e-12)


# ---- what Mitsuba resolves ----------------------------------------------------------------------

SLAB = """
integrator: {{type: whitted}}
shapes:
  - {{type: rectangle, transform: [{{scale: 2}}]}}
  - {{type: rectangle, transform: [{{scale: [1, 2, 1]}}, {{translate: [-1, 0, {gap}]}}]}}
"""


def _resolved(text: str) -> Resolution:
    found = Scene.parse(text)
    return resolution(found, build_tables(found), load(found))


def test_narrow_gaps_are_foretold_and_found() -> None:
    """Of a floor half under a slab, the part below is left for what lies above the slab."""
    narrow = _resolved(SLAB.format(gap=1e-5))
    assert narrow.is_limited
    assert narrow.missed <= 0.01 * narrow.found
    assert narrow.found <= 1.05 * narrow.foretold
    wide = _resolved(SLAB.format(gap=0.1))
    assert not wide.is_limited
    assert wide.foretold <= 0.01 * wide.hits


@pytest.mark.slow
@pytest.mark.parametrize("name", ["grazing", "nested_glass", "planet"])
def test_what_is_foretold_is_what_is_found(name: str) -> None:
    of = scene(name)
    found = resolution(of, build_tables(of), load(of))
    assert found.is_limited
    assert found.missed <= 0.02 * found.found
    # What may go wrong does not wherever rounding falls to the harmless side: half, or a bit more.
    assert 0.4 * found.foretold <= found.found <= 1.02 * found.foretold


@pytest.mark.parametrize(
    "resolved",
    [
        Resolution(1000, 12, 48, 36, 1e-3, 1e-6),  # found, but not foretold: that is a fault
        Resolution(1000, 50, 2, 0, 1e-3, 1e-6),  # foretold, but Mitsuba can
    ],
)
def test_without_a_limit_they_differ(resolved: Resolution) -> None:
    below = RungResult("geometry", "agree", "", {"resolution": resolved._asdict(), "rays": 1000})
    above = RungResult("images", "differ", "other")

    def explained(share: float) -> Rest:
        return Rest("agree", "the rest agrees")

    assert limited([below, above], explained)[1].status == "differ"
    broken = replace(below, status="differ")
    assert limited([broken, above], explained)[1].status == "differ"
    assert limited([above], explained)[0].status == "differ"


def test_a_light_that_float32_cannot_aim_at_is_not_called_dark() -> None:
    """Mitsuba's rays pass by a lamp 1e-7 wide, which the arbiter knows; a lamp of another radiance
    is seen all the same."""
    lit = scene("tiny_light")
    lamp = lit.shapes[7].model_copy(update={"transform": _narrowed(lit)})
    lit = lit.changed(shapes=(*lit.shapes[:7], lamp, *lit.shapes[8:]))
    tables = build_tables(lit)
    assert direct(lit, tables, load(lit), 60).status in ("agree", "reference-limited")
    other = lit.materials["small"].model_copy(update={"radiance": (1.11e5, 1e5, 8.5e4)})
    faulty = lit.changed(materials={**lit.materials, "small": other})
    assert direct(lit, tables, load(faulty), 60).status == "differ"


def _narrowed(lit: Scene) -> tuple[Any, ...]:
    return (Scale(scale=(0.01, 0.01, 0.01)), *lit.shapes[7].transform)

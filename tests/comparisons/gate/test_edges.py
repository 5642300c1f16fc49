"""Pictures without noise: edges by what footprints see, the other pixels exactly.

The rasteriser here paints triangles over each other, with any samples, its vertices snapped to a
grid.  It shares nothing with a renderer."""

import numpy as np
import pytest

from comparisons.gate.gate import gate_pictures
from comparisons.gate.pictures_in import Picture
from comparisons.gate.question import Question
from comparisons.gate.reference import of_scene
from comparisons.report.biases import biases_of
from comparisons.results.case import RungResult
from comparisons.rungs import edges
from comparisons.rungs.edges import RULES, Edges, edges_rung
from comparisons.rungs.footprints import Look, look_at
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.image import srgb
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.textures.image_file import linear

WIDTH, HEIGHT = 64, 48

CENTRE = [(0.0, 0.0)]
OTHERS = {
    "3 x 3": [(x, y) for y in (-16 / 3, 0, 16 / 3) for x in (-16 / 3, 0, 16 / 3)],
    "quincunx": [(0, 0), (5, 5), (-5, 5), (5, -5), (-5, -5)],
    "two beside each other": [(-4, 0), (4, 0)],
    "three": [(-5, -1), (1, 5), (4, -4)],
}
"""Lawful samples that are not among RULES, in sixteenths of a pixel."""


class Triangles:
    """Shaded triangles before a background, the last in front."""

    def __init__(self, seed: int, count: int = 10, bright: bool = False) -> None:
        rng = np.random.default_rng(seed)
        centres = rng.uniform([0, 0], [WIDTH, HEIGHT], (count, 1, 2))
        angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, (count, 3)))
        around = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        self.corners = centres + rng.uniform(4.0, 20.0, (count, 1, 1)) * around
        self.colours = rng.uniform(0.6 if bright else 0.05, 1.0, (count + 1, 3))
        self.colours[0] = 0.05 if bright else self.colours[0]
        self.slopes = rng.uniform(-0.3, 0.3, (count + 1, 2))

    def look(
        self, at: FloatArray, corners: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        def shade(k: int) -> FloatArray:
            slope = np.tanh((at - [WIDTH / 2, HEIGHT / 2]) / WIDTH @ self.slopes[k])
            return np.asarray(self.colours[k] * (1.0 + 0.5 * slope)[..., None])

        seen, far = shade(0), np.full(at.shape[:-1], np.inf)
        for k, triangle in enumerate(self.corners if corners is None else corners):
            sides = [
                (b[0] - a[0]) * (at[..., 1] - a[1]) - (b[1] - a[1]) * (at[..., 0] - a[0])
                for a, b in zip(triangle, np.roll(triangle, -1, axis=0), strict=True)
            ]
            inside = (np.min(sides, axis=0) > 0.0) | (np.max(sides, axis=0) < 0.0)
            seen = np.where(inside[..., None], shade(k + 1), seen)
            far = np.where(inside, 30.0 - k, far)
        return seen, far

    def snapped(self, bits: int, cut: bool) -> FloatArray:
        return (np.floor if cut else np.round)(self.corners * 2.0**bits) / 2.0**bits

    def picture(
        self,
        samples: object = CENTRE,
        corners: FloatArray | None = None,
        shift: tuple[float, float] = (0.0, 0.0),
        encoded: bool = False,
    ) -> FloatArray:
        """encoded: samples are averaged as sRGB values."""
        y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
        at = np.stack([x, y], axis=-1) + np.array(shift)
        found = [self.look(at + np.array(s) / 16.0, corners)[0] for s in np.asarray(samples)]
        if encoded:
            return np.asarray(linear(np.mean([srgb(x) for x in found], axis=0)))
        return np.asarray(np.mean(found, axis=0))


def judged(
    scene: Triangles,
    candidate: FloatArray,
    reference: FloatArray | None = None,
    *,
    displayed: bool = False,
    tolerance: float = edges.TOLERANCE,
) -> RungResult:
    known = scene.picture() if reference is None else reference
    return edges_rung(candidate, known, Edges(scene.look, tolerance), displayed)


SAMPLES = {**RULES, **OTHERS}


@pytest.mark.parametrize("k", range(len(SAMPLES)))
def test_right_rasterisers_agree(k: int) -> None:
    """With any lawful samples and grid of vertices, against one sample and against sixteen."""
    scene = Triangles(k)
    corners = [None, scene.snapped(4, False), scene.snapped(4, True), scene.snapped(8, False)]
    samples = list(SAMPLES.values())[k]
    reference = scene.picture(CENTRE if k % 2 else RULES["4 x 4 samples"])
    for moved in corners[k % 2 :: 2]:
        found = judged(scene, scene.picture(samples, moved), reference)
        assert found.status == "agree", found.reason
        assert found.numbers["edge"] > 200


@pytest.mark.slow
def test_false_alarms_in_many_pictures() -> None:
    rng = np.random.default_rng(0)
    alarms = []
    for seed in range(500):
        scene = Triangles(seed + 100, int(rng.integers(1, 15)), bool(rng.integers(2)))
        samples = list(SAMPLES.values())[rng.integers(len(SAMPLES))]
        corners = scene.snapped(int(rng.choice([4, 5, 8])), bool(rng.integers(2)))
        reference = scene.picture(CENTRE if rng.integers(2) else RULES["4 x 4 samples"])
        found = judged(scene, scene.picture(samples, corners), reference)
        alarms += [found.reason] if found.status != "agree" else []
    assert len(alarms) <= 1, alarms


def test_one_wrong_choice_is_lawful_and_many_are_not() -> None:
    """A silhouette pixel that shows the other surface; a pixel inside may not."""
    scene = Triangles(3)
    right, other = scene.picture(), scene.picture(shift=(0.4, 0.0))
    flipped = np.argwhere(np.abs(other - right).max(axis=-1) > 0.2)
    candidate = right.copy()
    y, x = flipped[7]
    candidate[y, x] = other[y, x]
    found = judged(scene, candidate)
    assert found.status == "agree", found.reason
    assert found.numbers["choices"] == 1
    assert found.numbers["edge"] > 200  # those that do not differ, too
    for y, x in flipped[:20]:
        candidate[y, x] = other[y, x]
    found = judged(scene, candidate)
    assert found.status == "differ"
    assert "show another surface than one sample at the centre" in found.reason
    candidate = right.copy()
    y, x = flipped[7]
    candidate[y, x] = 2.0
    found = judged(scene, candidate)
    assert f"1 of {found.numbers['edge']:,} pixels on edges show what none of" in found.reason
    corners = [scene.picture(shift=(x, y)) for x in (-0.6, 0.6) for y in (-0.6, 0.6)]
    flat = np.argwhere(np.ptp(corners, axis=0).max(axis=-1) < 0.01)
    candidate = right.copy()
    y, x = flat[len(flat) // 2]
    candidate[y, x] *= 1.01
    found = judged(scene, candidate)
    assert found.status == "differ"
    assert f"1 of {found.numbers['inside']:,} pixels inside surfaces differ" in found.reason
    assert f"the worst, at x, y = ({x}, {y})" in found.reason


def test_the_tip_of_a_triangle_that_was_moved() -> None:
    """It lies between the nodes of its pixel, and is moved onto a sample."""
    scene = Triangles(5, 4)
    scene.corners[3] = [[20.1, 20.34], [26.0, 20.2], [26.0, 20.5]]
    moved = scene.corners - np.array([0.0, 0.03])
    found = judged(scene, scene.picture(RULES["8 samples"], moved))
    assert found.status == "agree", found.reason
    assert found.numbers["choices"] == 1


def test_of_many_wrong_pixels_none_is_taken_for_a_tip(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor looked at as one, which takes longer than all the rest."""
    looked = []

    def noting(look: Look, law: object, row: FloatArray, *more: FloatArray) -> object:
        looked.append(len(row))
        return np.ones(len(row), np.bool_)

    monkeypatch.setattr(edges, "_are_tips", noting)
    scene = Triangles(1)
    assert judged(scene, 1.1 * scene.picture()).status == "differ"
    assert looked == [0]


def nearest(
    scene: Triangles, reach: float, n: int, offset: tuple[float, float] = (0.0, 0.0)
) -> FloatArray:
    """Each pixel shows the nearest surface of n x n points, up to `reach` pixels from its centre
    and the offset; where that is the one there, its own shade."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    at = np.stack([x, y], axis=-1) + np.array(offset)
    seen, best = scene.look(at)
    for u in np.linspace(-reach, reach, n):
        for v in np.linspace(-reach, reach, n):
            other, far = scene.look(at + np.array([u, v]))
            seen = np.where((far < best)[..., None], other, seen)
            best = np.minimum(far, best)
    return seen


FAULTS = {
    "half a pixel in x": lambda s: s.picture(shift=(0.5, 0.0)),
    "half a pixel in y": lambda s: s.picture(shift=(0.0, -0.5)),
    "a corner of the pixel": lambda s: s.picture(shift=(-0.5, -0.5)),
    "half a pixel of 4 samples": lambda s: s.picture(RULES["4 samples"], shift=(0.5, 0.5)),
    "a quarter of a pixel": lambda s: s.picture(shift=(0.25, 0.0)),
    "any coverage counts": lambda s: nearest(s, 0.499, 15),
    "grown by a pixel": lambda s: nearest(s, 1.0, 3),
    "resolved in sRGB": lambda s: s.picture(RULES["8 samples"], encoded=True),
    "a triangle culled": lambda s: s.picture(corners=s.corners[:5]),
    "painted in the wrong order": lambda s: s.picture(corners=s.corners[::-1]),
}  # fmt: skip


def grown(scene: Triangles, reach: float) -> FloatArray:
    """Surfaces that are `reach` pixels too large, with 16 samples."""
    return np.asarray(np.mean([
        nearest(scene, reach, 5, (x / 16, y / 16)) for x, y in RULES["4 x 4 samples"]
    ], axis=0))  # fmt: skip


BIASES = {
    "shift in x of +": lambda s: s.picture(RULES["4 x 4 samples"], shift=(0.2, 0.0)),
    "shift in y of -": lambda s: s.picture(RULES["4 x 4 samples"], shift=(0.0, -0.2)),
    "growth of what is near of +": lambda s: grown(s, 0.2),
}


@pytest.mark.parametrize("name", BIASES)
def test_a_bias_that_no_single_pixel_shows(name: str) -> None:
    scene = Triangles(7, 14)
    scene.slopes[:] = 0.0  # flat: what is inside does not change
    found = judged(scene, BIASES[name](scene))
    assert found.status == "differ"
    assert f"edges have a bias: {name}" in found.reason


@pytest.mark.cases(len(FAULTS))
@pytest.mark.parametrize("seed", range(50, 53))
@pytest.mark.parametrize("name", FAULTS)
def test_faults_at_edges_are_seen(name: str, seed: int) -> None:
    scene = Triangles(seed, bright=name == "resolved in sRGB")
    found = judged(scene, FAULTS[name](scene))
    assert found.status == "differ", found.reason
    if name == "resolved in sRGB":
        assert "edges have a bias: brightness of -" in found.reason
        assert not found.numbers["inside_wrong"] + found.numbers["edge_wrong"]


def test_tolerance_and_display_codes() -> None:
    """Values within the tolerance; 8-bit pictures within half a code, and one that is cut off."""
    scene = Triangles(1)
    right = scene.picture()
    for gain, tolerance, agrees in (
        (1.0009, 1e-3, True),
        (1.003, 1e-3, False),
        (1.003, 4e-3, True),
    ):
        found = judged(scene, gain * right, tolerance=tolerance)
        assert (found.status == "agree") == agrees, found.reason
    codes = 255.0 * srgb(np.clip(right, 0.0, 1.0))
    floored = np.round(codes)
    floored[:12] = np.floor(codes[:12])
    for shown, status in ((np.round(codes), "agree"), (floored, "differ")):
        found = judged(scene, linear(shown / 255.0), displayed=True)
        assert found.status == status, found.reason


SCENE = """
camera: {type: perspective, eye: [0.3, 0.4, 4], target: [0, 0, 0], fov: 40}
film: {width: 40, height: 30}
integrator: {type: whitted, max_depth: 2}
materials:
  red: {type: diffuse, reflectance: [0.7, 0.3, 0.2]}
  grey: {type: diffuse, reflectance: 0.5}
shapes:
  - {type: sphere, radius: 0.8, material: red}
  - {type: rectangle, material: grey, transform: [{scale: 1.5}, {translate: [0.3, 0.1, -1]}]}
lights: [{type: point, position: [3, 2, 2], intensity: 30}]
"""  # fmt: skip


def test_a_scene_through_the_gate() -> None:
    scene = Scene.parse(SCENE)
    look = look_at(scene)
    assert look is not None
    y, x = np.mgrid[0:30, 0:40] + 0.5
    reference = of_scene(scene, 0.005)
    at = np.stack([x, y], axis=-1)
    np.testing.assert_array_equal(look(at)[0], reference.pictures[0])

    several = np.mean([look(at + s / 16.0)[0] for s in RULES["2 x 2 samples"]], axis=0)
    case = gate_pictures([Picture(several)], reference, Question(edges=Edges(look)))
    assert case.verdict == "agree", case.reason  # shading is no plane in a pixel

    def gated(shift: float, rim: int = 0):  # type: ignore[no-untyped-def]
        moved = look(at + np.array([shift, 0.0]))[0].astype(np.float32).astype(np.float64)
        return gate_pictures([Picture(moved)], reference, Question(edges=Edges(look), rim=rim))

    for rim in (0, 3):
        case = gated(0.04, rim)  # within what a rasteriser's grid of vertices may move
        assert case.verdict == "agree", case.reason
        numbers = next(r.numbers for r in case.rungs if r.name == "statistics")
        assert numbers["inside"] + numbers["edge"] == (30 - 2 * rim) * (40 - 2 * rim)
        assert numbers["edge"] > 50
        head = [title.partition(" ")[2] for title in biases_of(case).head]
        assert head[1:3] == ["pixels inside surfaces", "pixels on edges"]
        assert gated(0.5, rim).verdict == "differ"


def test_a_dithered_picture_of_a_scene() -> None:
    """It is off by a code on edges, too."""
    scene = Scene.parse(SCENE)
    look, reference = look_at(scene), of_scene(scene, 0.005)
    assert look is not None
    noise = np.random.default_rng(1).uniform(-0.5, 0.5, (30, 40, 3))
    codes = np.clip(np.round(255.0 * srgb(np.clip(reference.pictures[0], 0, 1)) + noise), 0, 255)
    shown = Picture(linear(codes / 255.0), quantised=True, displayed=True)
    case = gate_pictures([shown], reference, Question(edges=Edges(look)))
    assert case.verdict == "agree", case.reason


def test_scenes_without_footprints() -> None:
    """Random radiance, wider filters, and pictures of other layers."""
    for old, new in (
        ("{type: whitted, max_depth: 2}", "{type: path}"),
        ("{type: whitted, max_depth: 2}", "{type: ray_cast, show: normal}"),
        ("height: 30", "height: 30, filter: {type: tent}"),
    ):
        assert look_at(Scene.parse(SCENE.replace(old, new))) is None


def test_direct_light_is_seen_without_noise() -> None:
    """A ray that is no pixel of a grid draws one of two lights at random: each is seen alone."""
    scene = Scene.parse("""
film: {width: 6, height: 5}
camera: {type: perspective, eye: [0, 0, 4], target: [0, 0, 0], fov: 40}
integrator: {type: direct}
sampler: {type: grid}
materials: {grey: {type: diffuse, reflectance: 0.5}}
shapes: [{type: sphere, material: grey}]
lights:
  - {type: point, position: [1, 2, 4], intensity: 30}
  - {type: directional, direction: [1, 0, -1], irradiance: 2}
""")
    look = look_at(scene)
    assert look is not None
    across, down = np.meshgrid(np.arange(6) + 0.5, np.arange(5) + 0.5)
    seen, _ = look(np.stack([across, down], axis=-1))
    np.testing.assert_allclose(seen, render(scene).colour, rtol=1e-12, atol=1e-15)

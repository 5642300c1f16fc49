"""Lamps with measured intensities: the second reading of their files, and our plugin for Mitsuba,
which share nothing with the renderer's."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders import random_turn, unit_vectors
from counterparts import faulty_counterpart
from photometry import READ

import reference_rt as rt
from comparisons.lights import BY_TYPE, translate_light
from comparisons.lights.goniometric import second_reading, table_of
from comparisons.lights.light import Motion
from comparisons.mitsuba.backend import mitsuba, scalar
from comparisons.mitsuba.context import NO_CONTEXT
from comparisons.rungs import direct
from comparisons.translator import load
from comparisons.translator.reading import read_dict
from comparisons.translator.writing import write_xml
from reference_rt.lights.lm63 import parse

VERTICAL = (0.0, 10.0, 25.0, 60.0, 90.0, 140.0, 180.0)
HORIZONTAL = (
    (0.0,),
    (0.0, 15.0, 40.0, 90.0),
    (0.0, 15.0, 40.0, 90.0, 150.0, 180.0),
    (90.0, 100.0, 150.0, 220.0, 270.0),
    (0.0, 20.0, 200.0, 300.0, 360.0),
)
PLACE: dict[str, Any] = {"origin": (1.0, 2.0, -3.0), "target": (1.5, 1.0, -2.7)}


def lamp(horizontal: tuple[float, ...], **fields: Any) -> rt.Goniometric:
    values = np.random.default_rng(3).uniform(1.0, 9.0, (len(horizontal), len(VERTICAL)))
    table = {"vertical_angles": VERTICAL, "horizontal_angles": horizontal, "values": values}
    return rt.Goniometric(**{**PLACE, **table, "intensity": (3.0, 2.0, 1.0), **fields})


@pytest.mark.parametrize("year", READ)
def test_a_second_reading_of_files(year: str, tmp_path: Path) -> None:
    content = READ[year][0].encode("latin-1")
    found, ours = second_reading(content), parse(content)
    for one, other in zip(found, ours[:3], strict=True):
        np.testing.assert_allclose(one, other, rtol=4e-16)
    (tmp_path / "a.ies").write_bytes(content)
    by_name = table_of(rt.Goniometric(**PLACE, file="a.ies"), tmp_path)
    assert all(np.array_equal(one, other) for one, other in zip(found, by_name, strict=True))


@pytest.mark.parametrize("variant", ["scalar_rgb", "llvm_ad_rgb"])
@pytest.mark.parametrize("horizontal", HORIZONTAL, ids=str)
def test_our_plugin_shines_as_the_renderer(horizontal: tuple[float, ...], variant: str) -> None:
    """Both interpolate in double precision, of points that float32 rounds: by 1e-7 of their size,
    which turns directions by as much over the distance."""
    light = lamp(horizontal, c0=(0.3, 1.0, 2.0))
    way = unit_vectors(np.random.default_rng(6), 60)
    p = np.float64(np.float32(np.array(PLACE["origin"]) + 2.0 * way))
    scene = rt.Scene(lights=(light,))
    ours = scene.sample_lights(p, np.full((len(p), 3), 0.5)).radiance
    if variant == "scalar_rgb":
        with scalar() as mi:
            theirs = irradiance(mi, light, p)
    else:
        theirs = irradiance(mitsuba(), light, p)
    assert ours.max() > 1.0
    steepest = 8.0 / math.radians(10.0) / math.sin(math.radians(10.0)) * 3.0 / 4.0
    far = np.abs(way @ np.subtract(light.target, light.origin)) < 0.98 * math.dist(*PLACE.values())
    np.testing.assert_allclose(theirs[far], ours[far], rtol=1e-6, atol=2e-7 * steepest)


def irradiance(mi: Any, light: rt.Goniometric, p: Any) -> Any:
    emitter = mi.load_dict(translate_light(light, NO_CONTEXT))
    found = []
    for point in p.tolist():
        it = mi.SurfaceInteraction3f()
        it.p = mi.Point3f(*point)
        found.append(np.ravel(emitter.sample_direction(it, mi.Point2f(0.5, 0.5))[1]))
    return np.array(found)


@pytest.mark.parametrize("horizontal", HORIZONTAL, ids=str)
def test_it_is_read_again(horizontal: tuple[float, ...]) -> None:
    """By <lookat> in a file; in memory by its matrix, whose columns are unit vectors."""
    light = lamp(horizontal)
    found = read_dict({"type": "scene", "lamp": translate_light(light, NO_CONTEXT)}, rt.Scene)
    (again,) = found.lights
    w = unit_vectors(np.random.default_rng(6), 60)
    p, u = np.array(PLACE["origin"]) + w, np.full((len(w), 3), 0.5)
    one, other = (rt.Scene(lights=(x,)).sample_lights(p, u).radiance for x in (light, again))
    np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("horizontal", HORIZONTAL, ids=str)
def test_it_moves_with_the_world(horizontal: tuple[float, ...]) -> None:
    """Turned, moved and three times as large, it lights the same; no lamp of ours is its mirror
    image, unless the table is changed."""
    light, rng = lamp(horizontal, c0=(0.3, 1.0, 2.0)), np.random.default_rng(6)
    turn, shift = random_turn(rng), np.array([4.0, -5.0, 6.0])
    place = lambda p: tuple((3.0 * (turn @ p) + shift).tolist())  # noqa: E731
    motion = Motion(place, lambda d: tuple((turn @ d).tolist()), 3.0, ())
    there = BY_TYPE[rt.Goniometric].moved(light, motion)
    p = np.array(PLACE["origin"]) + unit_vectors(rng, 60)
    u = np.full((len(p), 3), 0.5)
    one = rt.Scene(lights=(light,)).sample_lights(p, u).radiance
    other = rt.Scene(lights=(there,)).sample_lights(3.0 * p @ turn.T + shift, u).radiance
    # Rounding of the places turns directions by some 1e-15, which the steepest table has 1e3 times.
    np.testing.assert_allclose(other, one, rtol=1e-10, atol=1e-11)
    assert BY_TYPE[rt.Goniometric].moved(light, motion._replace(steps=({"scale": -1},))) is None


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", r"a.ies: has no line 'TILT='"),
        (READ["2002"][0].encode()[:-9], r"a.ies: line 11: the file ends before value 5 of 8"),
        (None, "a.ies: cannot be read: No such file"),
    ],
)
def test_a_wrong_file_is_told_when_a_scene_is_written(
    content: bytes | None, message: str, tmp_path: Path
) -> None:
    if content is not None:
        (tmp_path / "a.ies").write_bytes(content)
    light = "{type: goniometric, origin: [0, 1, 0], target: [0, 0, 0], file: a.ies}"
    (tmp_path / "s.yaml").write_text(f"lights:\n  - {light}\n")
    with pytest.raises(rt.SceneError, match=rf"s.yaml:2: lights\[0\]: .*{message}"):
        write_xml(rt.Scene.load(tmp_path / "s.yaml"), tmp_path / "s.xml")
    assert not (tmp_path / "s.xml").exists()


FLOOR = """
camera: {type: perspective, eye: [0, 1, 6], target: [0, 0, 0], fov: 60}
film: {width: 48, height: 40}
integrator: {type: whitted}
shapes: [{type: rectangle, transform: [{scale: 6}, {rotate: {axis: [1, 2, 0], degrees: 9}}]}]
lights:
  - type: goniometric
    origin: [0.2, 0.1, 3]
    target: [0, 0, 0]
    c0: [1, 0.2, 0]
    vertical_angles: [0, 20, 45, 60]
    horizontal_angles: [0, 45, 90, 180, 270, 360]
    values: [[5, 4, 2, 0], [5, 6, 3, 0], [5, 2, 1, 0], [5, 3, 3, 1], [5, 1, 2, 0], [5, 4, 2, 0]]
"""

FAULTS = {
    "mirrored": ("[5, 6, 3, 0], [5, 2, 1, 0], [5, 3, 3, 1], [5, 1, 2, 0]",
                 "[5, 1, 2, 0], [5, 3, 3, 1], [5, 2, 1, 0], [5, 6, 3, 0]"),
    "turned by a degree": ("c0: [1, 0.2, 0]", "c0: [1, 0.218, 0]"),
    "one value a hundredth larger": ("[5, 2, 1, 0]", "[5, 2.02, 1, 0]"),
    "one vertical angle a tenth of a degree off": ("[0, 20, 45, 60]", "[0, 20.1, 45, 60]"),
    "one horizontal angle half a degree off": ("[0, 45, 90", "[0, 45.5, 90"),
    "dark beyond the last but one": ("[0, 20, 45, 60]", "[0, 20, 45, 45.01]"),
    "a seam that does not close": ("[5, 4, 2, 0]]", "[5, 4.2, 2, 0]]"),
}  # fmt: skip


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", FAULTS)
def test_faults_of_a_table_are_found(name: str) -> None:
    right, wrong = FAULTS[name]
    scene = rt.Scene.parse(FLOOR)
    with scalar():
        assert direct(scene, scene.tables, load(scene), 300).status == "agree"
        faulty = faulty_counterpart(FLOOR, right, wrong)
        assert direct(scene, scene.tables, faulty, 300).status == "differ"

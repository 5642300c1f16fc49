"""Other renderers' conventions: undone, named where they are left in, and hiding nothing else."""

import json
import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from gate_checks import BALL_ON_A_FLOOR

from comparisons import gate
from comparisons.gate.conventions import RENDERERS, Changes
from comparisons.gate.pictures_in import Picture
from comparisons.gate.request import Request, gated
from comparisons.gate.undone import Reading, Undo, cosines
from comparisons.results.case import Case, FloatArray
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import UsageError

BALL = (
    BALL_ON_A_FLOOR.replace("width: 48, height: 32", "width: 36, height: 24")
    .replace("target: [0, 0.4, 0]", "target: [0.3, 0.4, 0]")
    .replace("point, position: [2, 3, 2], intensity: [40, 50, 60]", "LAMP")
)

LAMPS = {
    "point": "point, position: [2, 3, 2], intensity: [40, 50, 60]",
    "spot": "spot, origin: [2, 3, 2], target: [0, 0, 0], intensity: [40, 50, 60], cutoff_angle: 40",
    "directional": "directional, direction: [-1, -2, -1], irradiance: [2, 3, 4]",
}


def scene_of(lamp: str = "point") -> Scene:
    return Scene.parse(BALL.replace("LAMP", LAMPS[lamp]))


def made(undo: Undo) -> FloatArray:
    """What a right renderer with these conventions makes."""
    described = undo.described()
    assert described is not None
    return undo.applied(render(described).colour)


def named(scene: Scene, picture: FloatArray) -> str:
    case = gated(Request(scene=scene), [Picture(picture)])
    assert case.verdict == "differ"
    return "" if case.cause is None else case.cause.name


NO_CONVENTION = {
    "rotated": Changes(mirrored=True, upside_down=True),
    "one pixel high": Changes(down=-1.0),
    "twice as bright": Changes(lights={"point": 2.0}),
}


@pytest.mark.cases(1)
@pytest.mark.parametrize("which", NO_CONVENTION)
def test_what_no_renderer_does_is_nobodys(which: str) -> None:
    scene = scene_of()
    assert ", as " not in named(scene, made(Undo(NO_CONVENTION[which], scene)))


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", RENDERERS)
@pytest.mark.parametrize("numbers", [False, True])
def test_what_is_undone_agrees_and_a_fault_beyond_it_differs(name: str, numbers: bool) -> None:
    lights = RENDERERS[name].changes.lights
    if numbers and not lights:
        return
    scene = scene_of(next(iter(lights), "point"))
    text = f"{name}:numbers" if numbers else name
    reading = Reading.of(text, scene, of_files=False)
    right = made(reading.undo)

    def read(picture: FloatArray) -> Case:
        request = Request(scene=reading.scene(scene))
        return reading.told(gated(request, reading.read([Picture(picture)])))

    case = read(right)
    assert case.verdict == "agree", case.reason
    words = reading.undo.changes.words()
    assert any(note.startswith(f"read as {RENDERERS[name].title}") for note in case.notes)
    for word in words:
        assert word in case.reason
    assert read(1.01 * right).verdict == "differ"
    dark = right.copy()
    dark[10:14, 14:18] *= 0.9
    assert read(dark).verdict == "differ"
    if words:
        assert read(render(scene).colour).verdict == "differ"


def test_the_cosine_is_that_of_the_rays() -> None:
    scene = scene_of()
    rays = scene.camera_rays()[1]
    forward = np.array(scene.camera.target) - np.array(scene.camera.eye)
    expected = rays @ (forward / np.linalg.norm(forward))
    np.testing.assert_allclose(cosines(scene, (24, 36)), expected, rtol=1e-12)


@pytest.mark.parametrize("changes", [Changes(True, True, cosine=True), Changes(cosine=True)])
def test_reading_is_the_inverse_of_what_happened(changes: Changes) -> None:
    undo = Undo(changes, scene_of())
    right = np.random.default_rng(0).random((24, 36, 3))
    shown = undo.applied(right)
    assert not np.allclose(shown, right)
    np.testing.assert_allclose(undo.read([Picture(shown)])[0].radiance, right, rtol=1e-12)


def test_a_moved_view_shows_the_same_picture_elsewhere() -> None:
    """Of a scene that is nowhere singular, one sample a pixel at the same places."""
    scene = scene_of().changed(camera=scene_of().camera)
    plain = render(scene).colour
    moved = Undo(Changes(right=2.0, down=1.0), scene).described()
    assert moved is not None
    np.testing.assert_allclose(render(moved).colour[1:, 2:], plain[:-1, :-2], rtol=1e-9)


@pytest.mark.slow
def test_a_moved_orthographic_view() -> None:
    camera = {"type": "orthographic", "eye": (0, 2, 5), "target": (0.3, 0.4, 0), "width": 3.0}
    scene = Scene.parse(scene_of().changed(camera=camera).to_json())
    plain = render(scene).colour
    moved = Undo(Changes(right=-1.0, down=2.0), scene).described()
    assert moved is not None
    np.testing.assert_allclose(render(moved).colour[2:, :-1], plain[:-2, 1:], rtol=1e-9)


def test_pictures_against_pictures_are_cropped() -> None:
    picture = render(scene_of()).colour
    low = np.concatenate([np.zeros((1, 36, 3)), picture[:-1]])
    case = gate(1.0001 * low, reference=picture, noise_free=True, conventions="luxcore")
    assert case.verdict == "agree"
    assert "one pixel low" in case.reason
    assert gate(picture, reference=picture * 1.1, noise_free=True).verdict == "differ"
    differs = gate(low, reference=picture, noise_free=True)
    assert differs.verdict == "differ"
    assert differs.cause is not None
    assert differs.cause.name == "one pixel low, as LuxCore 2.11.2's"


IN_GLASS = """
camera: {type: perspective, eye: [0, 0, 0], target: [0.3, 0.1, 1], fov: 60}
film: {width: 10, height: 10}
sampler: {type: grid, spp: 4}
integrator: {type: whitted, max_depth: 5}
materials: {glass: {type: dielectric, interior_ior: 1.5}}
shapes:
  - {type: sphere, center: [0.2, 0, 0], radius: 1, material: glass}
lights: [{type: constant, radiance: [0.5, 1, 2]}]
"""


def test_glass_without_the_square_of_its_index_is_named() -> None:
    scene = Scene.parse(IN_GLASS)
    name = named(scene, render(scene).colour / 1.5**2)
    assert name.startswith("radiance without 1/eta² in glass, as Cycles 5.0.1's, POV-Ray")


@pytest.mark.slow
def test_another_factor_in_glass_is_no_index() -> None:
    scene = Scene.parse(IN_GLASS)
    assert "eta" not in named(scene, render(scene).colour / 1.4**2)


@pytest.mark.slow
def test_pictures_with_noise() -> None:
    text = BALL.replace("LAMP", LAMPS["point"]).replace("grid, spp: 4", "sobol, spp: 256")
    scene = Scene.parse(text.replace("direct", "path, max_depth: 4"))
    undo = Undo(RENDERERS["luxcore"].picture, scene)
    described = undo.described()
    assert described is not None
    sampler = described.resolved_sampler
    seeds = [sampler.model_copy(update={"seed": 50 + k}) for k in range(4)]
    made = [Picture(render(described.changed(sampler=one)).colour) for one in seeds]
    case = gated(Request(scene=scene, limit=0.02), made)
    assert case.verdict == "differ"
    assert case.cause is not None
    assert case.cause.name == "one pixel low, as LuxCore 2.11.2's"
    assert gated(Request(scene=described, limit=0.02), undo.read(made)).verdict == "agree"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("luxrender", "there is no luxrender; expected one of babylon"),
        ("luxcore:units", "there is no luxcore:units"),
        ("raysect:numbers", "numbers of these lights mean what ours do"),
    ],
)
def test_unknown_conventions(text: str, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        Reading.of(text, scene_of(), of_files=False)


def test_what_cannot_be_undone() -> None:
    scene = scene_of()
    with pytest.raises(UsageError, match="part of a pixel cannot be undone in pictures"):
        Reading.of("tachyon", None, of_files=True)
    with pytest.raises(UsageError, match="expected --scene too"):
        Reading.of("raysect", None, of_files=True)
    wide = {"type": "orthographic", "eye": (0, 2, 5), "target": (0.3, 0.4, 0)}
    flat = Scene.parse(scene.changed(camera=wide).to_json())
    with pytest.raises(UsageError, match="no cosine"):
        Reading.of("raysect", flat, of_files=False)


def test_the_command(tmp_path: Path) -> None:
    scene = scene_of()
    (tmp_path / "ball.yaml").write_text(scene.to_yaml(), encoding="utf-8")
    np.save(tmp_path / "low.npy", made(Undo(Changes(down=1.0), scene)))
    command = ["gate", str(tmp_path / "low.npy"), "--scene", str(tmp_path / "ball.yaml")]
    command += ["--out", str(tmp_path / "out")]
    result = invoke(*command, "--from", "luxcore")
    assert result.exit_code == 0, result.output
    assert "one pixel low" in result.output
    facts = json.loads((tmp_path / "out" / "results.json").read_text(encoding="utf-8"))
    assert "one pixel low" in json.dumps(facts)
    assert "one pixel low" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert invoke(*command, "--from", "nobody").exit_code == 2


ROOT = Path(__file__).parents[3]
MEASURE = ROOT / "docs" / "measure_conventions.py"

NEEDS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("babylon", "three"), ("playwright",)),
    "cycles": ("bpy",),
    "luxcore": ("pyluxcore",),
    "mitsuba": ("mitsuba",),
    "radiance": ("pyradiance",),
    "raysect": ("raysect",),
}
"""The packages of renderers that are no programs; some cannot be installed together."""

PACKAGES = Path(os.environ.get("NODE_MODULES", ROOT / "examples" / "three" / "node_modules"))


def skip_without(name: str) -> None:
    packages = NEEDS.get(name, ())
    if any(find_spec(package) is None for package in packages):
        pytest.skip(f"{packages[0]} is not installed")
    if not packages and shutil.which(name) is None:
        pytest.skip(f"{name} is not installed")
    of_npm = {"three": "three", "babylon": "babylonjs"}.get(name)
    if of_npm and not ((PACKAGES / of_npm).is_dir() and shutil.which("chromium")):
        pytest.skip(f"{of_npm} by npm, or Chromium, is not installed")


@pytest.mark.slow
@pytest.mark.parametrize("name", RENDERERS)
def test_what_renderers_really_do(name: str) -> None:
    """The table is what a renderer that is installed does now."""
    known = RENDERERS[name]
    skip_without(name)
    command = [sys.executable, str(MEASURE), name]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=600)
    found = json.loads(next(line for line in done.stdout.splitlines() if line.startswith("{")))
    assert Changes(**found["placed"]) == known.picture
    if known.glass is not None:
        # Radiance's files have 8 bits, and rays of LuxCore noise.
        assert found["glass"] == pytest.approx(1.5**2 if known.glass else 1.0, rel=0.01)
    for kind, factor in found["lamps"].items():
        assert factor == pytest.approx(known.changes.lights.get(kind, 1.0), rel=0.005)


TABLE = ROOT / "docs" / "results" / "renderers.jsonl"

LEFT = 0.25
"""Percent of a formula's picture beside its edges: noise of the path tracers, a mesh for a ball."""


@pytest.mark.slow
@pytest.mark.parametrize("name", RENDERERS)
def test_six_scenes_by_each_renderer(name: str) -> None:
    """The table of docs/results/renderers.md is what renderers that are installed draw now."""
    skip_without(name)
    measure = ROOT / "docs" / "measure_renderers.py"
    command = [sys.executable, str(measure), name]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=1800)
    rows = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("[")]
    known = [json.loads(line) for line in TABLE.read_text(encoding="utf-8").splitlines()]
    assert [row[:3] for row in rows] == [row[:3] for row in known if row[0] == name]
    for _, scene, verdict, *_, formula, left in rows:
        assert verdict != "differ" or (formula and left < LEFT), scene

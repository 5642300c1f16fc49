"""Derivatives at the gate: by files, by arrays, by a renderer's own pictures, in a test."""

import numpy as np
import pytest
from command_line import invoke

import comparisons
from comparisons.gate.derivative import Asked, case_of
from reference_rt import Scene, derivative
from reference_rt.util.errors import ImageError, UsageError

ROOM = """
film: {width: 8, height: 8}
camera: {type: perspective, eye: [0, -2, 2], target: [0, 0, 0], up: [0, 0, 1], fov: 50}
integrator: {type: path, max_depth: 3}
sampler: {type: sobol, spp: 256}
materials: {floor: {type: diffuse, reflectance: 0.5}, ball: {type: diffuse, reflectance: 0.7}}
shapes:
  - {type: rectangle, material: floor, transform: [{scale: 4}]}
  - {type: sphere, material: ball, radius: 0.5, center: [0, 0, 0.5]}
lights: [{type: constant, radiance: [1, 0.8, 0.6]}]
"""

ALBEDO = "materials.floor.reflectance"


@pytest.fixture(scope="module")
def right():
    return derivative(Scene.parse(ROOM), ALBEDO, spp=1024, seed=77).replicates


def scene():
    return Scene.parse(ROOM)


def test_a_scene_judges(right):
    asked = Asked(scene=scene(), parameter=ALBEDO, limit=0.02)
    assert case_of(right, asked).verdict == "agree"
    wrong = case_of(1.05 * right, asked)
    assert (wrong.verdict, wrong.cause.name) == ("differ", "a constant factor")


def test_a_closed_form_judges():
    """A picture that is p^2 everywhere, at 3."""
    exact = np.full((4, 4, 3), 6.0)
    noisy = exact + np.random.default_rng(1).normal(scale=0.02, size=(8, 4, 4, 3))
    assert comparisons.gate_derivative(noisy, closed=exact, limit=0.02).verdict == "agree"
    assert comparisons.gate_derivative(0.9 * noisy, closed=exact).verdict == "differ"


def own_picture(value: float, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return value**3 * (1.0 + 0.01 * rng.normal(size=(4, 4, 3)))


def test_the_renderers_own_pictures_judge():
    """By 3 p^2, with the noise of other seeds."""
    found = np.stack([3.0 * 2.0**2 * own_picture(1.0, seed) for seed in range(50, 66)])
    assert (
        comparisons.gate_derivative(found, primal=own_picture, at=2.0, limit=0.02).verdict
        == "agree"
    )
    wrong = comparisons.gate_derivative(2.0 * found, primal=own_picture, at=2.0)
    assert wrong.cause.name == "another unit of the parameter"


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"parameter": ALBEDO},
        {"primal": own_picture},
        {"closed": np.zeros((4, 4, 3)), "primal": own_picture, "at": 1.0},
    ],
)
def test_what_is_compared_with_is_one_thing(given):
    with pytest.raises(UsageError, match="expected"):
        comparisons.gate_derivative(np.ones((2, 4, 4, 3)), **given)


def test_bad_candidates_are_refused(right):
    with pytest.raises(UsageError, match="two or more"):
        comparisons.gate_derivative(right[:1], scene=scene(), parameter=ALBEDO)
    with pytest.raises(ImageError, match="4 x 4"):
        comparisons.gate_derivative(np.ones((2, 4, 4, 3)), scene=scene(), parameter=ALBEDO)
    broken = np.where(np.arange(8)[:, None] == 3, np.nan, right)
    assert case_of(broken, Asked(scene=scene(), parameter=ALBEDO)).verdict == "invalid"


def test_the_command(right, tmp_path):
    path = tmp_path / "room.yaml"
    path.write_text(ROOM)
    np.save(tmp_path / "d.npy", -right)
    np.save(tmp_path / "exact.npy", right.mean(axis=0))
    out = ["-o", str(tmp_path / "out")]
    by = ["--derivative", ALBEDO]
    found = invoke("gate", str(tmp_path / "d.npy"), "--scene", str(path), *by, *out)
    assert found.exit_code == 1
    assert "the sign" in found.stdout
    assert (tmp_path / "out/report.html").exists()
    exact = ["--reference", str(tmp_path / "exact.npy")]
    assert invoke("gate", str(tmp_path / "d.npy"), *exact, *by, *out).exit_code == 1
    assert invoke("gate", *exact, *by, *out).exit_code == 2
    assert invoke("gate", str(tmp_path / "d.npy"), *exact, "--step", "1", *out).exit_code == 2


@pytest.mark.parametrize(
    "option",
    [
        *(["--junit", "x.xml"], ["--github"], ["-D", "a=1"], ["--witness", "cycles"]),
        *(["--baseline", "room"], ["--noise-free"], ["--rim", "1"], ["--truth", "disk_lamp"]),
    ],
    ids=lambda option: option[0],
)
def test_no_option_is_passed_over_in_silence(tmp_path, option):
    exact = ["--reference", "exact.npy", "--derivative", "radius", "-o", str(tmp_path)]
    found = invoke("gate", "d.npy", *exact, *option)
    assert found.exit_code == 2
    assert "does not apply to --derivative" in found.stderr


def test_the_fixture(derivative_gate, right, tmp_path, monkeypatch):
    """A right derivative passes, and a wrong one fails the test with its cause."""
    monkeypatch.setattr(derivative_gate, "_out", tmp_path)
    found = np.stack([12.0 * own_picture(1.0, seed) for seed in range(50, 66)])
    derivative_gate(found, primal=own_picture, at=2.0, limit=0.02)
    with pytest.raises(pytest.fail.Exception, match=r"derivative_gate: differ.*the sign"):
        derivative_gate(-found, primal=own_picture, at=2.0)

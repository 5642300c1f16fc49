"""Derivatives: identities that hold exactly, honest errors, bounds, warnings, files.  Those with
edges and their closed forms are in tests/comparisons/truth/test_truth_derivatives.py."""

import math
from typing import Any

import numpy as np
import pytest
from builders import SCENES

from reference_rt import Scene, UsageError, derivative, read_image, render
from reference_rt.rendering import derivative as module
from reference_rt.rendering.derivative import difference

MIRRORS = """
camera: {type: orthographic, eye: [0, 0, 5], target: [0, 0, 0], width: 1}
film: {width: 3, height: 2}
sampler: {type: sobol, spp: 32, seed: 3}
integrator: {type: path, max_depth: 3}
materials:
  silver: {type: mirror, reflectance: RHO}
  wall: {type: emissive, radiance: 1, base: silver}
shapes: # a floor and a ceiling without end
  - {type: rectangle, material: wall, transform: [{scale: 1.0e9}]}
  - {type: rectangle, material: wall, transform: [{scale: 1.0e9}, {rotate: {axis: [1, 0, 0], degrees: 180}}, {translate: [0, 0, 6]}]}
"""  # noqa: E501
"""Radiance 1 + rho + rho^2."""

SILHOUETTE = """
camera: {type: CAMERA, eye: [0.1, 0.2, 3]}
film: {width: 6, height: 4}
sampler: {type: sobol, spp: 64, seed: 1}
integrator: {type: INTEGRATOR}
materials:
  warm: {type: emissive, radiance: [1, 0.5, 0.2]}
shapes:
  - {type: sphere, material: warm, center: [0, 0.1, 0], radius: 0.7}
"""


def mirrors(rho: Any) -> Scene:
    return Scene.parse(MIRRORS.replace("RHO", str(rho)))


def silhouette(camera: str = "perspective", integrator: str = "path") -> Scene:
    text = SILHOUETTE.replace("CAMERA", camera).replace("INTEGRATOR", integrator)
    if camera == "thin_lens":
        text = text.replace("3]}", "3], aperture_radius: 0.05}")
    return Scene.parse(text)


@pytest.mark.parametrize(
    ("rho", "side"), [(0.5, "central"), (1.0, "backward"), (0.0, "forward"), (0.999, "central")]
)
def test_a_square_has_its_derivative_exactly_also_at_its_bounds(rho: float, side: str) -> None:
    """Differences of second order are exact for 1 + rho + rho^2: 1 + 2 rho in all channels, and
    along one axis for one.  Rounding: 100 units of 2^-53 over h, of 1/2048 at least."""
    scene = mirrors(rho)
    whole = derivative(scene, "materials.silver.reflectance")
    assert whole.side == side
    assert whole.value == (rho,) * 3
    np.testing.assert_allclose(whole.picture, 1.0 + 2.0 * rho, rtol=1e-10)
    assert np.abs(whole.truncation).max() < 1e-10
    red = derivative(scene, "materials.silver.reflectance[0]")
    np.testing.assert_allclose(red.picture[..., 0], 1.0 + 2.0 * rho, rtol=1e-10)
    assert not red.picture[..., 1:].any()


def test_the_truncation_of_a_cube_is_the_square_of_the_step() -> None:
    """x^3 has the difference 3 x^2 + h^2; a fourth edge of paths makes it of 1 + ... + rho^3."""
    scene = Scene.parse(MIRRORS.replace("RHO", "0.5").replace("max_depth: 3", "max_depth: 4"))
    found = derivative(scene, "materials.silver.reflectance", step=0.1875)
    np.testing.assert_allclose(found.truncation, 0.1875**2, rtol=1e-10)
    np.testing.assert_allclose(found.picture - found.truncation, 1 + 1 + 0.75, rtol=1e-10)
    (warning,) = found.warnings
    assert "the step, 0.1875, is too large: it adds about 1.3%" in warning


def test_replicates_are_differences_of_pictures_with_one_seed_each() -> None:
    scene = silhouette()
    found = derivative(scene, "shapes[0].radius", replicates=4)
    plan = difference(scene, "shapes[0].radius")
    for k in range(4):
        f = [render(one, spp=16, seed=1 + k).colour for one in plan.scenes]
        by_hand = sum(w * one for w, one in zip(plan.weights, f, strict=True))
        assert np.array_equal(found.replicates[k], by_hand)
    assert found.spp == 64
    assert np.array_equal(found.picture, found.replicates.mean(axis=0))
    error = found.replicates.std(axis=0, ddof=1) / 2.0
    assert np.array_equal(found.standard_error, error)


def test_the_number_of_threads_changes_no_bit() -> None:
    one, two = (derivative(silhouette(), "camera.eye[2]", threads=n) for n in (1, 2))
    assert np.array_equal(one.replicates, two.replicates)
    assert np.array_equal(one.truncation, two.truncation)


def test_it_costs_two_pictures_and_one_part_in_sixteen(monkeypatch: pytest.MonkeyPatch) -> None:
    """Samples: 16 replicates of both scenes, and one of both at twice the step."""
    taken = []

    def counted(scene: Any, **options: Any) -> Any:
        taken.append(scene.resolved_sampler.spp)
        return render(scene, **options)

    monkeypatch.setattr(module, "render", counted)
    found = derivative(silhouette(), "shapes[0].radius", spp=64)
    assert sum(taken) == 2 * 64 * (1 + 1 / 16)
    assert found.spp == 64


@pytest.mark.parametrize("integrator", ["path", "direct", "whitted", "light"])
def test_light_is_homogeneous_with_every_integrator(integrator: str) -> None:
    """Radiance is in proportion to the lamps: its derivative is the picture over their radiance."""
    scene = silhouette(integrator=integrator)
    found = derivative(scene, "materials.warm.radiance[0]", replicates=1)
    picture = render(scene).colour[..., 0]
    np.testing.assert_allclose(found.picture[..., 0], picture, rtol=1e-9)


def test_ray_casting_has_derivatives_too() -> None:
    """With points in the middle of pixels: its colour is what is shown, here in its sampler."""
    scene = silhouette(integrator="ray_cast").changed(sampler=None)
    found = derivative(scene, "shapes[0].radius")
    assert len(found.replicates) == 1
    assert np.isinf(found.standard_error).all()
    assert "points of a grid miss edges" in " ".join(found.warnings)


@pytest.mark.parametrize("camera", ["perspective", "orthographic", "pinhole", "thin_lens"])
def test_an_eye_and_its_target_move_as_all_else_the_other_way(camera: str) -> None:
    """By relativity; each sample sees the same, but for the rounding of coordinates."""
    scene = silhouette(camera)
    by_shape = derivative(scene, "shapes[0].center[0]", step=1 / 64)
    f = {}
    for sign in (1, -1):
        eye = (0.1 + sign / 64, 0.2, 3.0)
        view = scene.camera.model_copy(update={"eye": eye, "target": (sign / 64, 0.0, 0.0)})
        f[sign] = [render(scene.changed(camera=view), spp=4, seed=1 + k).colour for k in range(16)]
    by_eye = (np.array(f[1]) - np.array(f[-1])) * 32.0
    np.testing.assert_allclose(by_eye, -by_shape.replicates, atol=1e-9)


def test_standard_errors_and_the_noise_of_the_truncation_are_what_is_said() -> None:
    """Of 24 derivatives with other seeds.  The variance between the means of whole pictures is that
    which they state: F(23, 360) is within 0.35 and 2.2 with a chance of 0.996.  The standard error
    of the truncation over that of the picture is .94, see the module: of 24 by 72 values, most of
    which are 0, within 3 of the standard errors of 24 alone, 1 / sqrt(48)."""
    found = [
        derivative(silhouette(), "shapes[0].radius", seed=1000 * seed, spp=32, step=1 / 64)
        for seed in range(24)
    ]
    of = np.array([one.replicates.mean(axis=(1, 2, 3)) for one in found])
    assert 0.35 < of.mean(axis=1).var(ddof=1) / (of.var(axis=1, ddof=1).mean() / 16) < 2.2
    truncation = np.var([one.truncation for one in found], axis=0, ddof=1).sum()
    picture = np.var([one.picture for one in found], axis=0, ddof=1).sum()
    assert math.sqrt(truncation / picture) == pytest.approx(0.94, rel=0.43)


def test_warnings_say_why_no_statement_is_possible() -> None:
    scene = silhouette()
    noisy = derivative(scene, "shapes[0].radius", spp=16)
    assert "too much for a statement" in noisy.warnings[0]
    unseen = derivative(scene, "camera.near", step=1e-3)
    assert "nothing changes, beyond rounding, with camera.near" in unseen.warnings[0]
    small = derivative(scene, "materials.warm.radiance", step=1e-12)
    assert "rounding shows" in small.warnings[-1]
    assert not derivative(scene, "materials.warm.radiance").warnings


@pytest.mark.parametrize(
    ("path", "step", "said"),
    [
        ("materials.silver.reflectance", 0.3, r"a step of 0.3 .* from \[0.9, 0.9, 0.9\] crosses a"),
        ("materials.silver.reflectance", -1.0, "step: expected a number above 0, got -1"),
        ("materials.silver.reflectance", math.nan, "step: expected a number above 0"),
        ("shapes[0].transform[0].scale", 1e9, "crosses a bound: .* it flattens space"),
    ],
)
def test_a_step_across_a_bound_is_one_line(path: str, step: float, said: str) -> None:
    with pytest.raises(UsageError, match=said) as raised:
        derivative(mirrors(0.9), path, step=step)
    assert "\n" not in str(raised.value)


def test_files(tmp_path: Any) -> None:
    """All numbers in an .exr; a .png is red where it grows, and small ones are enlarged."""
    found = derivative(silhouette(), "shapes[0].radius")
    found.save(tmp_path / "d.exr")
    for layer, values in (
        ("", found.picture),
        ("standard_error", found.standard_error),
        ("truncation", found.truncation),
    ):
        read = read_image(tmp_path / "d.exr", layer)
        np.testing.assert_array_equal(read, values.astype(np.float32))
    found.save(tmp_path / "d.png")
    shown = read_image(tmp_path / "d.png")
    assert shown.shape[1] == 324  # 54 times 6
    grows = found.picture[..., 0] > 0.1 * found.picture.max()
    middle = shown[27 : 4 * 54 : 54, 27::54]
    assert (middle[grows][:, 0] > middle[grows][:, 2]).all()
    assert (middle[found.picture[..., 0] == 0.0] == 1.0).all()
    with pytest.raises(UsageError, match=r"expected \.exr or \.png"):
        found.save(tmp_path / "d.jpg")


def test_roulette_begins_late(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where paths are long it makes the noise less than half, .14 with many samples; a scene's own
    later beginning stays."""
    scene = Scene.load(SCENES / "truth" / "closed_room.yaml")
    late = derivative(scene, "materials.matte.reflectance", size=(4, 4), spp=64)
    monkeypatch.setattr(module, "ROULETTE", 5)
    early = derivative(scene, "materials.matte.reflectance", size=(4, 4), spp=64)
    green = 1
    assert (late.standard_error < 0.5 * early.standard_error)[..., green].mean() > 0.8
    own = scene.changed(integrator={"type": "path", "rr_depth": 30})
    found = derivative(own, "materials.matte.reflectance", size=(1, 1), spp=2)
    assert found.scene.integrator.rr_depth == 30

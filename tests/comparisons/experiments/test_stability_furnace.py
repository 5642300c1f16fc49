"""The families of furnaces, materials and radiometry: ours holds, and planted faults are seen."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from stability_runs import measured

from comparisons.experiments.stability import furnaces
from comparisons.experiments.stability.bsdfs import reciprocity, samples, values
from comparisons.experiments.stability.bsdfs.exact import density_between, fresnel, masking
from comparisons.experiments.stability.harness.bsdfs import Bsdf, Ours, Samples, towards
from comparisons.experiments.stability.harness.outcomes import OURS, FloatArray, of_errors, relative
from comparisons.experiments.stability.harness.series import Draw
from comparisons.experiments.stability.radiometry import points, solid_angles
from reference_rt.lights.emitters import point


def run(name: str, series: str, x: float, cases: int = 150) -> Any:
    """Ours alone."""
    return measured(name, series, x, Path(), cases, seed=3)[OURS]


@dataclass(frozen=True)
class Faulty:
    """Ours with one thing wrong."""

    ours: Bsdf
    fault: str

    def evaluate(self, wo: FloatArray, wi: FloatArray) -> FloatArray:
        value = self.ours.evaluate(wo, wi)
        if self.fault == "one-sided":
            value = value * (1.0 + 1e-11 * wo[:, :1])
        return value

    def pdf(self, wo: FloatArray, wi: FloatArray) -> FloatArray:
        density = self.ours.pdf(wo, wi)
        faults: dict[str, Any] = {
            "density": 1.0 + 0.3 * wi[:, 0],
            "too much": 1.01,
            "too little": 0.99,
        }
        return np.asarray(density * faults.get(self.fault, 1.0))

    def sample(self, wo: FloatArray, u: FloatArray) -> Samples:
        drawn = self.ours.sample(wo, u)
        if self.fault == "weight":
            return drawn._replace(weight=drawn.weight * (1.0 + 1e-6))
        if self.fault == "shines":
            return drawn._replace(weight=drawn.weight * 1.01)
        if self.fault == "nan":
            weight = drawn.weight.copy()
            weight[7] = math.nan
            return drawn._replace(weight=weight)
        return drawn


def planted(fault: str) -> Callable[..., Iterator[tuple[str, Bsdf]]]:
    def contestants(material: Any, draw: Draw) -> Iterator[tuple[str, Bsdf]]:
        yield OURS, Faulty(Ours.of(material), fault)

    return contestants


@pytest.mark.slow
@pytest.mark.parametrize(
    ("module", "family", "series", "fault", "x", "cases"),
    [
        (reciprocity, "F11", "grazing", "one-sided", 10.0, 150),
        (reciprocity, "F11", "roughness", "one-sided", 1.0, 150),
        (reciprocity, "F11", "matched indices", "one-sided", 1e5, 150),
        (samples, "F11", "weights", "weight", 1.0, 150),
        (samples, "F11", "weights", "density", 1.0, 150),
        (samples, "F11", "weights", "nan", 1e4, 150),
        (samples, "F11", "densities", "density", 1.0, 20_000),
        (samples, "F11", "densities", "too much", 1.0, 20_000),
        (samples, "F11", "densities", "too little", 1e4, 100_000),
        (furnaces, "F10", "open furnace", "shines", 1e4, 20_000),
    ],
)
def test_faults_of_materials_are_seen(
    module: Any, family: str, series: str, fault: str, x: float, cases: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr(module, "contestants", planted(fault))
    found = run(family, series, x, cases)
    assert found.failures > 0
    assert found.examples


@pytest.mark.parametrize(
    ("series", "x"), [("fresnel, matched indices", 1e5), ("fresnel, critical angle", 1e5)]
)
def test_the_text_books_fresnel_in_our_place_is_seen(
    series: str, x: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(values, "_ours", values._textbook)
    assert run("F11", series, x, 2_000).failures > 0


def test_a_faulty_point_light_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    def sample(points: Any, i: int, p: Any) -> Any:
        right = point.sample(points, i, p)
        return right._replace(radiance=right.radiance * (1.0 + 4e-15))

    monkeypatch.setattr(points, "point", SimpleNamespace(sample=sample))
    assert run("F12", "point light", 1e3).failures > 0


def test_wide_spots_are_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    right = points.spot.falloff
    wrong = SimpleNamespace(falloff=lambda table, i, w: min(1.0, right(table, i, w) * 1.01))
    monkeypatch.setattr(points, "spot", wrong)
    assert run("F12", "spot", 1e6).failures > 0


@pytest.mark.parametrize(
    ("module", "series", "kernel", "factor", "x"),
    [
        (solid_angles, "small spheres", "_of_sphere", 1.0 + 1e-8, 1e6),
        (solid_angles, "flat lights", "_of_rectangle", 1.0 - 1e-12, 1e20),
        (solid_angles, "flat lights", "_of_triangle", 1.0 + 1e-12, 1e20),
        (solid_angles, "lights that fill the sky", "_of_rectangle", 1.0 + 1e-9, 1e12),
    ],
)
def test_wrong_solid_angles_are_seen(
    module: Any, series: str, kernel: str, factor: float, x: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = getattr(module, kernel)

    def wrong(*arguments: Any) -> None:
        right(*arguments)
        arguments[-1][...] *= factor

    monkeypatch.setattr(module, kernel, wrong)
    assert run("F12", series, x).failures > 0


def test_lights_sampled_by_their_area_miss_the_sky(monkeypatch: pytest.MonkeyPatch) -> None:
    def by_area(p: FloatArray, u: FloatArray) -> FloatArray:
        q = np.zeros((len(u), 3))
        q[:, :2] = 2.0 * u - 1.0
        d2 = ((p[:, None] - q) ** 2).sum(axis=2)
        return np.asarray(d2 * np.sqrt(d2) / (4.0 * p[:, 2:]))

    monkeypatch.setattr(solid_angles, "_rectangle_densities", by_area)
    assert run("F12", "lights that fill the sky", 1.0).failures == 0
    assert run("F12", "lights that fill the sky", 1e3).failures > 100
    assert run("F12", "flat lights", 1e20).failures == 0


def test_the_exact_laws_closed_forms() -> None:
    n = np.array([1.5, 1.0 + 1e-8, 0.5])
    straight = fresnel(np.ones(3), n)
    np.testing.assert_allclose(straight.reflectance, ((n - 1) / (n + 1)) ** 2, rtol=1e-15)
    np.testing.assert_allclose(straight.transmittance, 4 * n / (n + 1) ** 2, rtol=1e-15)
    total = fresnel(np.array([-0.1, 0.1]), np.array([1.5, 1 / 1.5]))
    assert total.reflectance.tolist() == [1.0, 1.0]
    assert total.transmittance.tolist() == [0.0, 0.0]
    up = towards(np.ones(1), np.zeros(1))
    for kind in ("ggx", "beckmann"):
        assert density_between(kind, 0.5, up, up).density == pytest.approx(4 / math.pi, rel=1e-15)
        assert masking(kind, 0.5, up) == 1.0
    slope = towards(np.array([0.6]), np.zeros(1))  # alpha tan = 1 with alpha = 0.75
    expected = 2 / (1 + math.sqrt(2))
    assert masking("ggx", 0.75, slope) == pytest.approx(expected, rel=1e-15)


def test_errors_that_are_no_numbers_fail() -> None:
    found = of_errors(np.array([0.0, math.nan, math.inf, 2.0]), 1.0, {"case": lambda k: k})
    assert (found.cases, found.failures, found.worst) == (4, 3, math.inf)
    assert [e["case"] for e in found.examples] == [1, 2, 3]
    off = relative(np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.0, 1.0]))
    assert off.tolist() == [0.0, math.inf, 1.0]

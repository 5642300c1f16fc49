"""F14: ours holds (`test_stability_explained`), and planted faults of media are seen."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stability_runs import measured

import reference_rt as rt
from comparisons.experiments.stability.harness.outcomes import MITSUBA, OURS, FloatArray, U
from comparisons.experiments.stability.media import pictures, turns, ways


def failures(series: str, x: float, cases: int = 200, who: str = OURS) -> int:
    return measured("F14", series, x, Path(), cases, mitsuba=who == MITSUBA)[who].failures


# ---- ways ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("series", "x", "change"),
    [
        ("optical depth", 1e-8, {"sigma": 1.0 + 1e-6}),
        ("optical depth", 1.0, {"sigma": 1.0 + 1e-12}),
        ("optical depth", 600.0, {"sigma": 0.999}),
        ("thin layers", 1e5, {"bottom": 1.0 + 1e-6}),
        ("far away", 1e6, {"sigma": 1.0 + 1e-6}),
    ],
)
def test_layers_of_another_depth_are_seen(
    series: str, x: float, change: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ours has another layer than the one whose ways are computed exactly."""
    right = ways.Layer.scene

    def scene(layer: ways.Layer) -> rt.Scene:
        return right(layer._replace(**{k: f * getattr(layer, k) for k, f in change.items()}))

    assert failures(series, x) == 0
    monkeypatch.setattr(ways.Layer, "scene", scene)
    assert failures(series, x) > 0


@pytest.mark.parametrize(
    ("series", "x"), [("flights", 1e8), ("flights", 10.0), ("scattering in layers", 1e8)]
)
def test_the_textbooks_logarithm_in_our_place_is_seen(
    series: str, x: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Distances by -log(1 - u), whose subtraction rounds."""

    def flown(scene: rt.Scene, u: FloatArray) -> FloatArray:
        (medium,) = scene.media.values()
        distance = -np.log(1.0 - u) / medium.sigma_t[0]
        bottom = -scene.shapes[1].transform[-1].translate[2]
        return np.column_stack([distance < bottom, distance])

    monkeypatch.setattr(ways, "_flown", flown)
    assert failures(series, x) > 0


def test_mitsubas_medium_takes_part() -> None:
    """Its transmittance is right to float32; its flights keep no digit of small numbers."""
    assert failures("optical depth", 1.0, who=MITSUBA) == 0
    assert failures("flights", 2.0, who=MITSUBA) == 0
    assert failures("flights", 1e6, who=MITSUBA) > 0


# ---- phase functions ----------------------------------------------------------------------------


def test_the_textbooks_phase_function_in_our_place_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    def values(lobes: Any, cosines: FloatArray, out: FloatArray) -> None:
        out[:] = turns._textbook(float(lobes.g[0]), cosines)

    def directions(of: Any, d: FloatArray, u: FloatArray) -> FloatArray:
        return turns._textbooks_directions(of.g, d, u)

    monkeypatch.setattr(turns, "_values", values)
    monkeypatch.setattr(turns, "_our_directions", directions)
    assert failures("phase values", 1e8) > 0
    assert failures("turned light", 1e4) > 0


@pytest.mark.parametrize("fault", ["g", "sign", "around"])
@pytest.mark.parametrize("x", [10.0, 1e4])
def test_directions_of_another_density_are_seen(
    x: float, fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = turns._our_directions

    def directions(of: Any, d: FloatArray, u: FloatArray) -> FloatArray:
        if fault == "around":
            return right(of, d, u * (1.0, 0.9))
        if isinstance(of, rt.HenyeyGreenstein):
            away = 1.0 - abs(of.g)
            wrong = {"g": np.sign(of.g) * (1.0 - 1.2 * away), "sign": -of.g}[fault]
            of = rt.HenyeyGreenstein(g=wrong)
        return right(of, d, u)

    monkeypatch.setattr(turns, "_our_directions", directions)
    assert failures("phase densities", x, 20_000) > 0


def test_mitsubas_phase_functions_take_part() -> None:
    assert failures("phase values", 2.0, who=MITSUBA) == 0
    assert failures("phase values", 1e4, who=MITSUBA) > 0
    assert failures("phase densities", 10.0, 20_000, who=MITSUBA) == 0


# ---- pictures -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("series", "x"),
    [
        ("half spaces", 2.0),
        ("half spaces", 100.0),
        ("white layers", 1.0),
        ("absorption behind glass", 1.0),
        ("absorption behind glass", 1e10),
    ],
)
def test_darker_and_brighter_pictures_are_seen(
    series: str, x: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each picture is rendered once: their seeds tell them apart."""
    from comparisons.experiments.stability.harness import worlds

    right, made = worlds.ours, dict[tuple[int, ...], FloatArray]()
    for factor in (1.0, 0.95, 1.05):

        def ours(world: worlds.World, *rest: int, factor: float = factor) -> FloatArray:
            if rest not in made:
                made[rest] = right(world, *rest)
            return factor * made[rest]

        monkeypatch.setattr(worlds, "ours", ours)
        assert (failures(series, x) > 0) == (factor != 1.0), factor


@pytest.mark.parametrize("colour", range(3))
def test_one_colour_of_unlike_ones_is_seen(colour: int, monkeypatch: pytest.MonkeyPatch) -> None:
    right, factor = pictures.ours, np.where(np.arange(3) == colour, 0.97, 1.0)
    monkeypatch.setattr(pictures, "ours", lambda *a: factor * right(*a))
    assert failures("unlike colours", 100.0) == 1


def test_a_pixel_of_a_white_ball_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    right = pictures.ours

    def wrong(*arguments: Any) -> FloatArray:
        pixels = right(*arguments)
        pixels[7, 1] *= 1.0 + 2048.0 * U
        return pixels

    monkeypatch.setattr(pictures, "ours", wrong)
    assert failures("white balls behind glass", 1e3) == 1


def test_what_is_seldom_is_allowed_for() -> None:
    """A second scattering in a layer of the depth 0.001, which one path of 400,000 has."""
    assert failures("white layers", 1e-3) == 0
    assert pictures.RARE < 3e-3

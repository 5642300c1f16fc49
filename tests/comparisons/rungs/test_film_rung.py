"""The rung of the film: filters agree with themselves; wrong values, points and weights differ."""

from importlib import import_module
from typing import Any

import numpy as np
import pytest

from comparisons.rungs import grating
from comparisons.rungs.film import film
from reference_rt.cameras.film import (
    CatmullRomFilter,
    Filter,
    GaussianFilter,
    LanczosFilter,
    MitchellFilter,
    TentFilter,
    film_offset,
)
from reference_rt.rendering.render import render

RUNG = import_module("comparisons.rungs.film")

FILTERS: dict[str, Filter] = {
    "tent": TentFilter(),
    "narrow tent": TentFilter(radius=0.4),
    "wide tent": TentFilter(radius=3.3),
    "gaussian": GaussianFilter(),
    "wide gaussian": GaussianFilter(stddev=1.5),
    "mitchell": MitchellFilter(),
    "spline": MitchellFilter(b=1.0, c=0.0),
    "catmull_rom": CatmullRomFilter(),
    "lanczos": LanczosFilter(),
    "long lanczos": LanczosFilter(lobes=8),
}

RINGING = ("mitchell", "catmull_rom", "lanczos", "long lanczos")
"""Filters with negative values."""


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", FILTERS)
def test_filters_agree_with_themselves(name: str) -> None:
    found = film(FILTERS[name], FILTERS[name])
    assert found.status == "agree", found.reason
    assert 0.0 < found.numbers["max_error_over_bound"] < 1.0


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", FILTERS)
def test_points_of_another_filter_differ(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The filter's function is right, its points are a fiftieth too far out."""
    monkeypatch.setattr(
        RUNG,
        "film_offset",
        lambda setup, u: (1.02 * film_offset(setup, u)[0], film_offset(setup, u)[1]),
    )
    found = film(FILTERS[name], FILTERS[name])
    assert found.status == "differ"
    assert "points that we draw" in found.reason


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", RINGING)
def test_points_without_their_signs_differ(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RUNG, "film_offset", lambda setup, u: (film_offset(setup, u)[0], 1.0))
    assert "points that we draw" in film(FILTERS[name], FILTERS[name]).reason


def faulty(layer: str, change: Any) -> Any:
    """A renderer with a fault in one layer."""

    def rendered(scene: Any) -> Any:
        picture = render(scene)
        picture.layers[layer] = change(picture.layers[layer])
        return picture

    return rendered


def blurred(x: Any) -> Any:
    """What a tenth of each neighbour adds: as negative lobes that are lost."""
    return 0.8 * x + 0.1 * (np.roll(x, 1, axis=1) + np.roll(x, -1, axis=1))


@pytest.mark.cases(2)
@pytest.mark.parametrize("layer", ["colour", "albedo", "normal"])
@pytest.mark.parametrize("name", ["tent", "lanczos"])
@pytest.mark.parametrize(
    "change",
    [blurred, lambda x: 1.05 * x, lambda x: np.roll(x, 1, axis=1)],
    ids=["blurred", "brighter", "shifted"],
)
def test_gratings_show_faults_of_pictures(
    name: str, layer: str, change: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(grating, "render", faulty(layer, change))
    found = film(FILTERS[name], FILTERS[name])
    assert found.status == "differ"
    assert "grating" in found.reason


def test_another_filter_differs() -> None:
    assert "of their peak" in film(TentFilter(radius=1.1), TentFilter()).reason
    assert film(MitchellFilter(b=0.3334), MitchellFilter()).status == "differ"

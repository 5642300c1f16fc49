"""The samples of media: right ones pass, and each planted fault is named."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import reference_rt as rt
from comparisons.rungs.sampling import media as rung
from reference_rt.core.arrays import FloatArray
from reference_rt.media.tables import media_table
from reference_rt.rendering.scene import Scene

PHASES: tuple[Any, ...] = (
    rt.Isotropic(),
    rt.HenyeyGreenstein(g=0.6),
    rt.HenyeyGreenstein(g=-0.9999),
    rt.Rayleigh(),
    rt.BlendPhase(first=rt.HenyeyGreenstein(g=0.8), second=rt.HenyeyGreenstein(g=-0.3), weight=0.3),
)

COLOURED = rt.Homogeneous(sigma_t=(0.5, 1.0, 3.0), albedo=(0.9, 0.5, 0.2), scale=1.5)


def medium(phase: Any = None, **more: Any) -> rt.Homogeneous:
    fields = {"sigma_t": (0.5, 1.0, 3.0), "albedo": (0.9, 0.5, 0.2), **more}
    return rt.Homogeneous(**fields, **({} if phase is None else {"phase": phase}))


@pytest.mark.parametrize("phase", PHASES, ids=repr)
def test_right_media_pass(phase: Any):
    scene = Scene(media={"other": medium(), "this": medium(phase)})
    result = rung.check(scene)
    assert (result.status, result.numbers["media"]) == ("agree", 2), result.reason


@pytest.mark.parametrize(
    "given",
    [
        *(
            {"albedo": (0.0, 0.0, 0.0)},
            {"sigma_t": (1e-6, 1e-6, 1e-6)},
            {"sigma_t": (0.0, 1.0, 9.0)},
        ),
        *({"sigma_t": (1e5, 1e4, 1e3)}, {"scale": 0.0}, {"albedo": (1.0, 0.0, 1.0)}),
    ],
    ids=str,
)
def test_extreme_media_pass(given: dict[str, Any]):
    assert rung.check(Scene(media={"this": medium(**given)})).status == "agree"


@pytest.mark.parametrize(
    ("described", "sampled"),
    [
        (rt.HenyeyGreenstein(g=0.6), rt.HenyeyGreenstein(g=-0.6)),
        (rt.HenyeyGreenstein(g=0.6), rt.HenyeyGreenstein(g=0.5)),
        (rt.Rayleigh(), rt.Isotropic()),
        (PHASES[-1], PHASES[-1].model_copy(update={"weight": 0.4})),
    ],
    ids=repr,
)
def test_another_phase_function_is_found(described: Any, sampled: Any):
    lobes = media_table([medium(), medium(sampled)], [], []).lobes
    assert "its formula says" in rung.fault_of_densities(described, lobes, 1)
    assert "not scattered as" in rung.fault_of_directions(described, lobes, 1)
    assert rung.fault_of_densities(sampled, lobes, 1) == ""


def flights(change: Callable[[FloatArray], FloatArray], other: Any = None) -> str:
    """The fault of paths whose light is changed, or that fly in another medium."""

    def values(scene: Scene, count: int) -> FloatArray:
        if other is not None:
            scene = scene.changed(media={"medium": other})
        return change(rung.traced(scene, count))

    return rung.fault_of_flights(COLOURED, values)


def test_flights_that_are_not_beers_are_found():
    assert flights(lambda seen: seen) == ""
    assert "arrive" in flights(lambda seen: 1.02 * seen)
    assert "no multiples" in flights(lambda seen: seen * [1.0, 1.0, 1.01])
    grey = COLOURED.model_copy(update={"sigma_t": (1.0, 1.0, 1.0)})
    assert "no multiples" in flights(lambda seen: seen, grey)
    denser = COLOURED.model_copy(update={"scale": 1.6})
    assert flights(lambda seen: seen, denser)
    assert "more than one weight" in flights(
        lambda seen: seen * np.linspace(1.0, 2.0, len(seen))[:, None]
    )
    assert "no flight" in flights(np.zeros_like)

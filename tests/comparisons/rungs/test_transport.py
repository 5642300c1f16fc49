"""The rung `transport`: right pictures agree, noise with long tails is no difference, and faults
that the path tracers of both sides could share are seen."""

import importlib
from typing import Any

import numpy as np
import pytest
from builders import SCENES

import reference_rt as rt
from comparisons.experiments.selftest import of_transport
from comparisons.experiments.selftest.fault import PACKAGE, SourceFault, run_patched
from comparisons.rungs.transport import transport

RUNG: Any = importlib.import_module("comparisons.rungs.transport")

ALL = sorted(path.stem for path in SCENES.glob("*.yaml"))

FLOOR = rt.Rectangle(
    material="grey", transform=({"scale": 2.0}, {"rotate": {"axis": (1, 0, 0), "degrees": -90}})
)
LAMP = rt.Rectangle(
    material="lamp",
    transform=({"rotate": {"axis": (1, 0, 0), "degrees": 90}}, {"translate": (0.2, 2.0, 0.0)}),
)


def room(**parts: Any) -> Any:
    return rt.Scene(
        **{
            "camera": rt.Perspective(eye=(0.0, 1.5, 4.0), target=(0.0, 0.4, 0.0), fov=40.0),
            "film": rt.Film(width=12, height=9),
            "integrator": rt.Path(max_depth=4),
            "materials": {
                "grey": rt.Diffuse(reflectance=(0.7, 0.5, 0.3)),
                "lamp": rt.Emissive(radiance=(8.0, 9.0, 10.0), base="grey"),
            },
            "shapes": (FLOOR, rt.Sphere(material="grey", radius=0.5), LAMP),
            **parts,
        }
    )


def found(scene: Any) -> Any:
    return transport(scene, scene.tables, 1)


@pytest.mark.parametrize(
    "integrator",
    [
        rt.Path(max_depth=4),
        rt.Path(rr_depth=1, hide_emitters=True),
        rt.Path(max_depth=3, sampling="lights"),
        rt.Direct(),
        rt.Direct(light_samples=3, hide_emitters=True),
        rt.Light(max_depth=4),
    ],
    ids=str,
)
def test_right_pictures_agree(integrator: Any) -> None:
    result = found(room(integrator=integrator))
    assert result.status == "agree", result.reason
    assert result.numbers["lit_pixels_reached"] == 1.0
    assert max(result.numbers["image"]["detectable_bias"].values()) < 0.2


def test_what_has_no_particles_is_left_out_with_a_reason() -> None:
    sun = (rt.Directional(direction=(0.0, -1.0, 0.0), irradiance=1.0),)
    for parts, reason in (
        ({"integrator": rt.Whitted()}, "'whitted' does not follow light"),
        ({"integrator": rt.RayCast()}, "'ray_cast' does not follow light"),
        ({"integrator": rt.Path(max_depth=1)}, "no light falls on any surface"),
        ({"integrator": rt.Direct(shadows=False)}, "without shadows"),
        ({"shapes": (rt.Torus(material="lamp"), LAMP)}, "cannot draw points"),
        ({"shapes": (rt.Plane(material="grey"),), "lights": sun}, "has no end"),
        ({"shapes": (FLOOR,)}, "no lamp that particles could leave"),
    ):
        result = found(room(**parts))
        assert result.status == "not-applicable"
        assert reason in result.reason


def test_particles_that_seldom_arrive_tell_nothing() -> None:
    """The camera sees a thousandth of what the lamp lights, in little light."""
    wide = rt.Rectangle(material="grey", transform=({"scale": 500.0}, *FLOOR.transform[1:]))
    away = (*LAMP.transform, {"translate": (400.0, 90.0, 0.0)})
    far = rt.Rectangle(material="lamp", transform=away)
    result = found(room(shapes=(wide, far)))
    assert result.status == "not-applicable"
    assert "too noisy to judge paths by" in result.reason
    assert result.numbers["lit_pixels_reached"] < 0.9


@pytest.mark.parametrize("factor", [1.3, 0.7, np.nan])
@pytest.mark.parametrize("of", [rt.Path, rt.Light])
def test_either_side_may_be_wrong(factor: float, of: type, monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(scene: Any, **settings: Any) -> Any:
        picture = rt.render(scene, **settings)
        if isinstance(scene.integrator, of):
            picture.colour[3:7, 4:] *= factor
        return picture

    monkeypatch.setattr(RUNG, "render", wrong)
    result = found(room())
    assert result.status == ("invalid" if np.isnan(factor) else "differ")


def test_light_of_one_channel_is_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    """The errors of the dark channels, over nothing, have no bound."""
    of_lamp = rt.Emissive(radiance=(8.0, 0.0, 0.0), base="grey")
    red = room(materials={**room().materials, "lamp": of_lamp})
    assert found(red).status == "agree"

    def wrong(scene: Any, **settings: Any) -> Any:
        picture = rt.render(scene, **settings)
        if isinstance(scene.integrator, rt.Light):
            picture.colour[3:7, 4:] *= 1.3
        return picture

    monkeypatch.setattr(RUNG, "render", wrong)
    assert found(red).status == "differ"


@pytest.mark.parametrize("light", ["sun", "sky"])
def test_particles_from_afar_must_fall_on_what_is_seen(light: str) -> None:
    """A speck so far away that the disk of the scene is 1e10 times as large as what is seen."""
    of = {
        "sun": rt.Directional(direction=(0.1, -1.0, 0.1), irradiance=(1.0, 1.0, 1.0)),
        "sky": rt.Constant(radiance=(1.0, 1.0, 1.0)),
    }[light]
    shapes = (FLOOR, rt.Sphere(material="grey", radius=0.5))
    speck = rt.Sphere(center=(0.0, 0.0, -3e5), material="grey")
    assert found(room(shapes=shapes, lights=(of,))).status == "agree"
    result = found(room(shapes=(*shapes, speck), lights=(of,)))
    assert result.status == "not-applicable"
    assert "fall on what the camera sees" in result.reason


def test_a_difference_that_other_samples_do_not_show_is_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    again = []

    def once(scene: Any, **settings: Any) -> Any:
        picture = rt.render(scene, **settings)
        if scene.sampler.seed < RUNG.FIRST_SEED + 2 * RUNG.REPLICATES:
            picture.colour[:] *= 1.3 if isinstance(scene.integrator, rt.Path) else 1.0
        else:
            again.append(scene.sampler.spp)
        return picture

    monkeypatch.setattr(RUNG, "render", once)
    assert found(room()).status == "agree"
    assert again == [RUNG.AGAIN * RUNG.SAMPLES // 108] * (2 * RUNG.REPLICATES)


def test_a_difference_whose_noise_does_not_fall_is_not_believed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As that of light which few samples find, of which more samples find more."""

    def noisy(scene: Any, **settings: Any) -> Any:
        picture = rt.render(scene, **settings)
        if isinstance(scene.integrator, rt.Path):
            picture.colour[:] *= 1.3 + 0.05 * np.random.default_rng(scene.sampler.seed).normal()
        return picture

    monkeypatch.setattr(RUNG, "render", noisy)
    result = found(room())
    assert result.status == "not-applicable"
    assert "too noisy to judge paths by" in result.reason


# ---- all scenes, and faults of the source --------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("name", ALL)
def test_every_scene(name: str, seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """No false alarm."""
    monkeypatch.setattr(RUNG, "FIRST_SEED", RUNG.FIRST_SEED + 1000 * seed)
    scene = rt.Scene.load(SCENES / f"{name}.yaml")
    result = transport(scene, scene.tables)
    assert result.status in ("agree", "not-applicable"), result.reason


@pytest.mark.slow
@pytest.mark.parametrize("fault", of_transport.SEEN, ids=lambda fault: fault.name)
def test_faults_of_the_path_tracer_are_seen(fault: SourceFault) -> None:
    """By this rung alone, without Mitsuba's pictures: it is the same if Mitsuba has the fault."""
    text = (PACKAGE / fault.file).read_text(encoding="utf-8")
    assert text.count(fault.old) == 1
    task = {
        "fault": fault.__dict__,
        "scenes": str(SCENES),
        "budgets": {"smoke": {}},
        "threads": None,
        "rungs": ["transport"],
    }
    worker = "comparisons.experiments.selftest.source_worker"
    patched = text.replace(fault.old, fault.new)
    (finding,) = run_patched(fault.file, patched, worker, task, 1200.0)
    assert finding["caught"], finding
    assert finding["rung"] == "transport"

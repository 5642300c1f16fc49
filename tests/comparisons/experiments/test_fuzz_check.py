"""The check of one scene: what it finds, and what it does not."""

import numpy as np
import pytest

from comparisons.experiments.fuzz import assets, check, identities
from comparisons.experiments.fuzz.finding import DETERMINISTIC, Effort, Finding, without_numbers
from comparisons.experiments.fuzz.generate import parse
from comparisons.experiments.fuzz.worker import alike, effort_for
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ReferenceUnavailableError

BALL = {
    "camera": {"type": "perspective", "eye": [0.0, 1.0, 5.0], "target": [0.0, 0.0, 0.0]},
    "film": {"width": 8, "height": 6},
    "sampler": {"type": "sobol", "spp": 2},
    "materials": {"grey": {"type": "diffuse"}},
    "shapes": [
        {"type": "sphere", "material": "grey"},
        {"type": "box", "transform": [{"scale": 0.7}]},
    ],
    "lights": [{"type": "point", "position": [2.0, 4.0, 3.0], "intensity": 30.0}],
}
budget_of = check.budget_of
FEW = Effort(pixels=16, light_pixels=16, identity_rays=60, spp=4)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return assets.write(tmp_path_factory.mktemp("files"))


def test_a_good_scene_has_no_finding(files):
    found = check.check(BALL, 4, FEW, files)
    assert found.findings == []
    assert found.lit
    assert found.rungs["geometry"] == found.rungs["whitted"] == found.rungs["direct"] == "agree"
    assert found.rungs["identity moved"] == "agree"
    assert found.rungs["statistics"] in ("agree", "inconclusive")
    assert "light:point" in found.types


def test_statistics_are_of_some_scenes_only(files):
    assert "statistics" not in check.check(BALL, 3, FEW, files).rungs


def test_what_differs_from_the_reference_is_found(files):
    """The rungs' names and causes, with another scene in Mitsuba."""
    ours = parse(BALL, "ours", files)
    for change, rung, cause in (
        ({"shapes": [{"type": "sphere", "radius": 0.9}]}, "geometry", "Mitsuba's wrong"),
        ({"materials": {"grey": {"type": "diffuse", "reflectance": 0.6}}}, "direct", "values"),
    ):
        other = parse({**BALL, **change}, "theirs", files)
        results = check.compare(ours, FEW, DETERMINISTIC, other)
        bad = next(r for r in results if r.status == "differ")
        found = check.of_rung(bad)
        assert found.rung == rung
        assert found.cause.startswith(cause)
        assert "differ" in found.detail
        assert "the first: " in found.detail


def test_light_differs_also_beside_what_mitsuba_cannot_resolve(files, monkeypatch):
    """A darker floor is no precision, whatever lies on it.  What Mitsuba resolves is measured only
    where light differs."""
    measured = []
    monkeypatch.setattr(
        check, "budget_of", lambda *given: measured.append(given[2]) or budget_of(*given)
    )
    below_a_slab = [
        {"type": "rectangle", "material": "grey", "transform": [{"scale": 2.0}]},
        {
            "type": "rectangle",
            "material": "grey",
            "transform": [{"scale": [1.0, 2.0, 1.0]}, {"translate": [-1.0, 0.0, 1e-5]}],
        },
    ]
    darker = {"grey": {"type": "diffuse", "reflectance": 0.4}}
    for shapes in (below_a_slab, BALL["shapes"]):
        ours = parse({**BALL, "shapes": shapes}, "ours", files)
        measured.clear()
        assert {r.status for r in check.compare(ours, FEW, DETERMINISTIC)} == {"agree"}
        assert measured == [False]
        measured.clear()
        other = parse({**BALL, "shapes": shapes, "materials": darker}, "theirs", files)
        results = check.compare(ours, FEW, DETERMINISTIC, other)
        assert {r.name: r.status for r in results}["direct"] == "differ"
        assert measured == [False, True]


def test_refused_scenes_are_found_as_such(files):
    broken = {**BALL, "shapes": [{"type": "sphere", "radius": -2.0}]}
    (found,) = check.check(broken, 1, FEW, files).findings
    assert found.rung == "scene"
    assert "radius" in found.detail


def test_errors_and_nan_are_found(files, monkeypatch):
    def nan(scene, **options):
        picture = render(scene, **options)
        picture.layers["colour"][2, 3] = np.nan
        return picture

    monkeypatch.setattr(identities, "render", nan)
    (found,) = check.check(BALL, 1, FEW, files).findings
    assert (found.rung, found.cause) == ("render", "the layer colour is not finite")
    assert "row 2, column 3" in found.detail

    def error(scene, **options):
        raise ZeroDivisionError("in tile 17")

    monkeypatch.setattr(identities, "render", error)
    (found,) = check.check(BALL, 1, FEW, files).findings
    assert found.cause.startswith("ZeroDivisionError in test_fuzz_check.py, error: in tile #")

    def missing(scene, **options):
        raise ReferenceUnavailableError("no Mitsuba")

    monkeypatch.setattr(identities, "render", missing)
    with pytest.raises(ReferenceUnavailableError):
        check.check(BALL, 1, FEW, files)


def test_a_difference_that_noise_made_does_not_count(files, monkeypatch):
    """The second look has other random numbers; what both show is found."""
    real, looks = check._failed, []

    def first_look_fails(case):
        looks.append(case)
        if len(looks) == 1:
            return next(r for r in case.rungs if r.name == "statistics")
        return real(case)

    monkeypatch.setattr(check, "_failed", first_look_fails)
    found = check.check(BALL, 4, FEW.model_copy(update={"rungs": ("statistics",)}), files)
    assert found.findings == []
    assert found.rungs["statistics"] == "false alarm"
    assert len(looks) == 2
    assert not np.array_equal(looks[0].images.candidate, looks[1].images.candidate)


def test_what_mitsuba_lacks_is_left_out_of_the_comparison(files):
    named = {"type": "normal_map", "normals": "t", "base": "grey"}  # of a texture without an image
    scene = {
        **BALL,
        "textures": {"t": {"type": "checker"}},
        "materials": {**BALL["materials"], "m": named},
        "shapes": [{"type": "sphere", "material": "m"}],
    }
    found = check.check(scene, 1, FEW.model_copy(update={"rungs": ("geometry",)}), files)
    assert found.rungs == {"plain": "compared", "geometry": "agree"}


def test_causes_have_no_numbers():
    assert without_numbers("5 of 0.25 rays, 1e-7 and nan  at 0x7f") == "# of # rays, # and # at #"


def test_a_reduction_keeps_rung_and_who_is_wrong():
    one = Finding(rung="geometry", cause="ours wrong: shape", detail="")
    assert alike(one.model_copy(update={"cause": "ours wrong: t"}), one)
    assert not alike(one.model_copy(update={"cause": "undecided: shape"}), one)
    assert not alike(one.model_copy(update={"rung": "direct"}), one)
    assert effort_for(FEW, one).rungs == ("geometry",)
    assert effort_for(FEW, one).pixels > FEW.pixels
    broken = one.model_copy(update={"rung": "identity moved"})
    assert effort_for(FEW, broken).rungs == ("identities",)


NEARLY_ON_THE_FLOOR = """
camera: {type: perspective, eye: [0.3, -1, 4], target: [0, 0, 0], up: [0, 1, 0], fov: 40}
film: {width: 16, height: 12}
sampler: {type: sobol, spp: 16}
integrator: {type: path, max_depth: 4}
materials: {pane: {type: principled, spec_trans: 1, roughness: 0.3}}
shapes:
  - {type: rectangle, transform: [{scale: 3}]}
  - {type: rectangle, material: pane, transform: [{scale: [1.5, 4, 1]}, {translate: [-2, 0, 2e-5]}]}
lights: [{type: point, position: [1, 1, 3], intensity: 10}]
"""


def test_pictures_that_mitsuba_does_not_resolve_are_no_finding() -> None:
    """Its shadow rays from the floor begin above the pane: the second look asks for that."""
    scene = Scene.parse(NEARLY_ON_THE_FLOOR)
    first, second = (check.pictures(scene, Effort(), below) for below in ((), ("geometry",)))
    found = [{rung.name: rung.status for rung in case.rungs} for case in (first, second)]
    assert [rungs["statistics"] for rungs in found] == ["differ", "reference-limited"]

"""Page, JSON and terminal say what is extrapolated, and which methods have no data."""

import itertools
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from convergence_fakes import EXACT, SHAPE, Fake, climbs

from comparisons.experiments.convergence import run
from comparisons.experiments.convergence.estimates import Estimate
from comparisons.experiments.convergence.findings import (
    Curves,
    Ratio,
    Target,
    compared,
    findings_of,
)
from comparisons.experiments.convergence.methods import (
    METHODS,
    AbsentError,
    Climb,
    Shot,
    climb,
)
from comparisons.experiments.convergence.outputs import lines_of, write_results
from comparisons.experiments.convergence.page import write_page
from comparisons.experiments.convergence.store import Settings, Store
from reference_rt.rendering.scene import Scene

SCENES = Path(__file__).parents[3] / "scenes"

BY_NAME = {c.name: c for c in METHODS}
MEASURED, BEYOND = 0.55, 1e-3
"""Relative errors that the fakes reach between their rungs, and far beyond the last one."""


def target(how, seconds=2.0):
    """Reached in about so many seconds."""
    drawn = seconds * np.exp(0.01 * np.random.default_rng(1).standard_normal(100))
    drawn[0] = seconds
    if how in ("bias", "unknown"):
        seconds = math.inf if how == "bias" else math.nan
        drawn = np.array([seconds])
    return Target(0.01, how, Estimate(seconds, 0.9 * seconds, 1.1 * seconds), 9.0, drawn)


# ---- ratios -------------------------------------------------------------------------------------


HOWS = ("interpolated", "extrapolated", "below", "bias", "unknown")


@pytest.mark.parametrize(("mine", "theirs"), list(itertools.product(HOWS, HOWS)))
@pytest.mark.parametrize("seconds", [0.2, 20.0])
def test_only_measurements_show_who_is_faster(mine, theirs, seconds):
    found = compared(target(mine, seconds), target(theirs))
    assert found.extrapolated == ("extrapolated" in (mine, theirs))
    unknown = "unknown" in (mine, theirs) or mine == theirs == "bias"
    assert (found.times is None) == unknown == bool(found.why)
    if found.extrapolated or unknown or mine == theirs == "below":
        assert found.shown == ""
    elif (mine, theirs) == ("interpolated", "interpolated"):
        assert found.shown == ("less" if seconds < 2.0 else "more")
    elif mine == "below" and theirs == "interpolated":  # an upper bound of the ratio
        assert (found.bound, found.shown) == ("at most", "less" if seconds < 2.0 else "")
    elif theirs == "below" and mine == "interpolated":
        assert (found.bound, found.shown) == ("at least", "more" if seconds > 2.0 else "")


def test_a_band_around_one_shows_nothing():
    assert Ratio(Estimate(0.9, 0.7, 1.1)).shown == ""


# ---- who fails ----------------------------------------------------------------------------------


class Failing(Fake):
    """Renders some pictures well, then fails in one of several ways."""

    def __init__(self, how: str, after: int) -> None:
        super().__init__()
        self.how, self.after = how, after

    def __call__(self, spp: int, replicate: int) -> Shot:
        self.after -= 1
        if self.after >= 0:
            return super().__call__(spp, replicate)
        if self.how == "raises":
            raise AbsentError("Mitsuba cannot render: no memory")
        picture = np.ones(SHAPE)
        picture[0, 0, 1] = math.nan if self.how == "nan" else math.inf
        return Shot(picture, spp, 1.0)


SAID = {
    "raises": "Mitsuba cannot render: no memory",
    "nan": "1 pixels of a picture of 4 samples per pixel are not finite",
    "inf": "1 pixels of a picture of 4 samples per pixel are not finite",
}


@pytest.mark.parametrize("how", SAID)
def test_one_that_fails_does_not_cost_the_others(how, tmp_path):
    fakes = {"ours": Fake(), "mitsuba_llvm": Failing(how, 3)}
    some = climbs(**fakes)
    climb(some, EXACT, 8, Store(tmp_path, "key"))
    assert some["mitsuba_llvm"].failed == SAID[how]
    assert some["mitsuba_llvm"].rungs == []
    assert [rung.replicates for rung in some["ours"].rungs] == [8, 8, 8]
    assert not list(tmp_path.glob("mitsuba_llvm-*"))  # nothing that a second run would take


def test_one_that_cannot_be_made_ready_does_not_either():
    def refuse() -> Fake:
        raise AbsentError("no such plugin")

    some = climbs(ours=Fake()) | {"x": Climb(refuse, (4, 8, 16), 100.0)}
    climb(some, EXACT, 2, Store(None, ""))
    assert some["x"].failed == "no such plugin"
    assert len(some["ours"].rungs) == 3


# ---- outputs ------------------------------------------------------------------------------------


def curves_of(scene, *, absent=None, targets=(MEASURED, BEYOND), **noises):
    """Curves of fakes, whose noise decides when they reach an error."""
    some = climbs(**{name: Fake(noise) for name, noise in noises.items()})
    climb(some, EXACT, 8, Store(None, ""))
    found = {n: findings_of(c.rungs, EXACT, targets, False) for n, c in some.items()}
    methods = {name: BY_NAME[name] for name in (*noises, *(absent or {}))}
    return Curves(scene, (16, 12), methods, found, EXACT, absent=absent or {})


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """The headline, the whole page and the JSON of four scenes."""
    folder = tmp_path_factory.mktemp("page")
    why = (
        "two rungs at least make a curve; rungs from 8 samples per pixel: 8 pictures would take 9 s"
    )
    curves = [
        curves_of("all", ours=1.0, mitsuba_llvm=1.3),
        curves_of("lonely", ours=1.0, absent={"mitsuba_llvm": why}),
        curves_of("without", mitsuba_llvm=1.3, absent={"ours": "<failed>"}),
        Curves("bad", problem="invalid: bad.yaml:3: shapes[1].file: cannot be read"),
    ]
    settings = Settings(targets=(MEASURED, BEYOND))
    write_page(folder / "page.html", curves, settings, {})
    write_results(folder / "results.json", curves, settings, {})
    page = (folder / "page.html").read_text(encoding="utf-8")
    headline = page[: page.index("<main>")]
    return headline, page, json.loads((folder / "results.json").read_text()), curves


class Interrupted(Fake):
    """A renderer that takes ten times as long for its pictures of 8 samples."""

    def __call__(self, spp, replicate):
        shot = super().__call__(spp, replicate)
        return shot._replace(seconds=shot.seconds * (10.0 if spp == 8 else 1.0))


def test_times_that_fall_as_samples_rise_are_left_out(tmp_path):
    """Of the rungs of 4, 8 and 16 samples the times of 4 and 16 make the curve, and the errors of
    all."""
    some = climbs(ours=Interrupted(), mitsuba_llvm=Fake())
    climb(some, EXACT, 8, Store(None, ""))
    wrong, right = (findings_of(c.rungs, EXACT, (MEASURED,), False) for c in some.values())
    assert [step.disturbed for step in wrong.steps] == [False, True, False]
    assert math.isnan(wrong.steps[1].seconds.value)
    assert not any(step.disturbed for step in right.steps)
    # Fakes take 1e-3 s a sample.
    assert wrong.targets[0].seconds.value == pytest.approx(1e-3 * wrong.targets[0].spp)
    assert wrong.slopes["mse"]["spp"] == right.slopes["mse"]["spp"]
    assert wrong.slopes["mse"]["seconds"] != right.slopes["mse"]["seconds"]
    curves = Curves("box", (16, 12), {"ours": BY_NAME["ours"]}, {"ours": wrong}, EXACT)
    (said,) = [line for line in lines_of(curves) if "disturbed" in line]
    assert said.startswith("box: ours: times with 8 samples are disturbed")
    settings = Settings(targets=(MEASURED,))
    write_results(tmp_path / "results.json", [curves], settings, {})
    stored = json.loads((tmp_path / "results.json").read_text())
    rung = stored["scenes"][0]["contestants"]["ours"]["rungs"][1]
    assert (rung["disturbed"], rung["seconds"]["median"]) == (True, None)
    write_page(tmp_path / "page.html", [curves], settings, {})
    assert (tmp_path / "page.html").read_text().count("<td>disturbed</td>") == 3


@pytest.mark.slow
def test_the_page_can_be_read_by_everybody(told, tmp_path, check_page):
    (tmp_path / "page.html").write_text(told[1], encoding="utf-8")
    check_page(tmp_path / "page.html")


def cells(part):
    """(class, text) of each cell of a table."""
    found = re.findall(r"<td(?: class=\"(\w*)\")?[^>]*>(.*?)</td>", part, re.DOTALL)
    return [(look, re.sub("<.*?>", " ", text).strip()) for look, text in found]


def test_the_headline_says_what_is_extrapolated(told):
    headline, page, *_ = told
    assert "Time to 0.1 % relative error" in headline  # the last target, which nobody measured
    found = cells(headline)
    looks = [look for look, text in found if "extrapolated" in text]
    assert looks == ["extrapolated", "extrapolated"]  # the ratio and the median
    assert "extrapolated" in found[0][1]
    assert found[0][1].startswith("≈ 0.")
    assert "of 1 scene, 1 extrapolated" in found[-1][1]
    assert "good" not in {look for look, _ in cells(headline)}
    # Where it was measured, the ratio is green.
    table = page[page.index("Time to a relative error") :]
    assert ("good", "extrapolated") not in [(look, text) for look, text in cells(table)]
    measured = [(look, text) for look, text in cells(table) if look == "good"]
    assert measured
    assert all("extrapolated" not in text for _, text in measured)


def test_the_headline_names_who_is_missing_and_why(told):
    headline, page, *_ = told
    assert (
        "lonely: Mitsuba llvm, independent (default): two rungs at least make a curve" in headline
    )
    assert "8 pictures would take 9 s" in headline
    assert "without: ours, Sobol&#39; (default and best): &lt;failed&gt;" in headline
    assert "<failed>" not in page
    assert ("bad", "no data see below") in cells(headline)
    assert ("bad", "no data for ours") in cells(headline)
    assert "invalid: bad.yaml:3: shapes[1].file: cannot be read" in headline


def test_json_and_terminal_say_the_same(told):
    *_, found, curves = told
    every, lonely, without, bad = found["scenes"]
    measured, beyond = every["ratios"]["mitsuba_llvm"]
    assert (measured["extrapolated"], beyond["extrapolated"]) == (False, True)
    assert measured["high"] < 1.0
    assert list(lonely["absent"]) == ["mitsuba_llvm"]
    assert without["absent"] == {"ours": "<failed>"}
    assert without["ratios"] == {}
    assert bad["problem"].startswith("invalid: bad.yaml:3")
    assert every["problem"] == every["absent"].get("x", "") == ""
    lines = lines_of(curves[0])
    assert re.search(
        r"ours: 55 % in [\d.e-]+ s, 0.1 % in about [\d.e+]+ s \(extrapolated\)$", lines[0][5:]
    )
    assert re.search(r"; ours / this: 0.\d\d, 0.\d\d \(extrapolated\)$", lines[1])
    assert lines_of(curves[1])[1].startswith("lonely: no data for Mitsuba llvm, independent (def")
    assert lines_of(curves[3]) == ["bad: invalid: bad.yaml:3: shapes[1].file: cannot be read"]


def test_who_is_never_there_is_part_of_the_median(tmp_path):
    """A method whose bias keeps it from the target must not drop out of the median."""
    from comparisons.experiments.convergence.page import _median

    never, half = Ratio(Estimate(math.inf, math.inf, math.inf)), Ratio(Estimate(0.5, 0.4, 0.6))
    assert _median([half, never, never])[0] == "∞"
    assert _median([half, half, never])[:2] == ("0.50", "of 3 scenes")
    assert _median([Ratio(None, why="unknown")])[0] == "–"


# ---- the command --------------------------------------------------------------------------------


@pytest.mark.slow
def test_an_invalid_scene_does_not_cost_the_others(tmp_path, monkeypatch):
    """Nor does a kill cost what is done: each scene that is missing says so."""
    missing = tmp_path / "missing.yaml"
    missing.write_text("shapes:\n  - {type: mesh, file: none.ply}\n")
    (tmp_path / "bad.yaml").write_text("shapes: [\n")

    def fake(scene, settings, store, say):
        _ = scene.tables
        if scene.name == "box":
            raise KeyboardInterrupt
        return curves_of(scene.name, targets=settings.targets, ours=1.0)

    monkeypatch.setattr(run, "converge", fake)
    sphere = "shapes: [{type: sphere}]\n"
    for name in ("ball", "box"):
        (tmp_path / f"{name}.yaml").write_text(sphere)
    files = [tmp_path / f"{name}.yaml" for name in ("bad", "missing", "ball", "box")]
    out = tmp_path / "out"
    result = invoke("converge", *files[:3], "-o", out)
    assert result.exit_code == 3, result.output
    scenes = json.loads((out / "results.json").read_text())["scenes"]
    assert scenes[0]["problem"].startswith(f"invalid: {tmp_path}/bad.yaml")
    assert scenes[1]["problem"].startswith(f"invalid: {missing}:2: shapes[0].file: ")
    assert list(scenes[2]["contestants"]) == ["ours"]
    assert f"missing: invalid: {missing}:2" in result.stdout
    result = invoke("converge", *files[2:], "-o", out)
    assert result.exit_code == 130
    scenes = json.loads((out / "results.json").read_text())["scenes"]
    assert [scene["problem"] for scene in scenes] == [
        "", "the run was interrupted before this case"
    ]  # fmt: skip
    assert "the run was interrupted" in (out / "report.html").read_text()


def test_a_method_without_enough_time_is_absent(monkeypatch):
    """As planned by the program itself."""
    scene = Scene.load(SCENES / "cornell_box.yaml")

    class Stable:
        def __init__(self, scene): ...
        def __enter__(self):
            return self

        def __exit__(self, *error): ...
        def ready(self, method, progress=None):
            if method.name == "mitsuba_scalar":
                raise AbsentError("no such plugin")
            return Fake(speed=10.0 if method.name == "mitsuba_llvm" else 1e-3)

    monkeypatch.setattr(run, "Stable", Stable)
    monkeypatch.setattr(run, "reference_of", lambda *_: EXACT)
    settings = Settings(
        time_limit=9.0, size=(16, 12), max_spp=16, crops=False,
        only=("ours", "mitsuba_llvm", "mitsuba_scalar"),
    )  # fmt: skip
    found = run.converge(scene, settings)
    assert list(found.findings) == ["ours"]
    assert set(found.methods) == {"ours", "mitsuba_llvm", "mitsuba_scalar"}
    assert found.absent["mitsuba_scalar"] == "no such plugin"
    assert found.absent["mitsuba_llvm"].startswith("two rungs at least make a curve; rungs from 4")
    assert found.left_out == ()

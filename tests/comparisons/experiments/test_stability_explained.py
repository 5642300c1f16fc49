"""All families say what they measure and hold; why Mitsuba's float32 holds as far as it does."""

import pytest
from stability_runs import measured

from comparisons.experiments.stability.harness.outcomes import MITSUBA, OURS
from comparisons.experiments.stability.harness.points import FURTHER, SeriesSummary, summarise
from comparisons.experiments.stability.harness.run import Choice, mitsuba_is_there, run
from comparisons.experiments.stability.harness.series import MODULES, family
from reference_rt.util.workers import Threads

# Cases have triangles without area on purpose: what a mesh leaves out is no news here.
pytestmark = pytest.mark.filterwarnings("ignore::reference_rt.util.errors.SceneWarning")

NAMES = tuple(MODULES)


def test_families_come_in_order():
    assert [family(name).id for name in NAMES] == [f"F{k}" for k in range(1, 15)]


@pytest.mark.parametrize("name", NAMES)
def test_a_series_is_whole(name):
    for series in family(name).series:
        assert set(series.quick) <= set(series.values), series.name
        assert series.settings("quick") == series.quick
        assert series.settings("full") == series.values
        assert set(series.cases) == {"quick", "full"}, series.name
        assert 0 < series.cases["quick"] <= series.cases["full"], series.name
        assert series.about.endswith("."), series.name
        assert all(min(series.values) <= x <= series.holds_to for x in series.quick), series.name


SERIES = pytest.mark.parametrize(
    ("name", "series"), [(name, s.name) for name in NAMES for s in family(name).series]
)


@SERIES
def test_ours_holds(name, series, tmp_path):
    """A few cases at the last point of the quick sweep."""
    one = family(name).by_name[series]
    cases = min(one.cases["quick"], 100)
    found = measured(name, series, (one.quick or one.values)[-1], tmp_path, cases)[OURS]
    assert found.cases + found.open > 0
    assert found.failures == 0, found.examples


@pytest.mark.slow
@SERIES
def test_ours_holds_everywhere(name, series, tmp_path):
    """At all points of a sweep within the guaranteed range, without Mitsuba."""
    one = family(name).by_name[series]
    for k, x in enumerate(x for x in one.values if x <= one.holds_to):
        folder = tmp_path / str(k)
        folder.mkdir()
        found = measured(name, series, x, folder, full=name == "F9")[OURS]
        assert found.failures == 0, (x, found.examples)


def unexplained(one: SeriesSummary) -> bool:
    """More than `SeriesSummary.unexplained`: also where Mitsuba does not fail at all."""
    if not one.mitsuba_took_part or one.series.explained:
        return False
    return one.further is None or one.further < FURTHER


@pytest.mark.slow
def test_no_series_is_unexplained(tmp_path):
    """The quick run of all: ours holds, and where Mitsuba does as well, the series says why."""
    if why := mitsuba_is_there():
        pytest.skip(why)
    found = run(Choice(NAMES, "quick", 1), tmp_path, Threads(2), lambda *_: None)
    for name in NAMES:
        for one in summarise(family(name), found):
            place = f"{name} {one.series.name}"
            assert one.holds, (place, one.broken, one.failed)
            assert not unexplained(one), place
            outcomes = [o for f in one.found for who, o in f.outcomes.items() if who == MITSUBA]
            if any(o.worst is not None for o in outcomes):
                assert one.series.unit, place
            assert all(OURS in f.outcomes for f in one.found), place

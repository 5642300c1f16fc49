"""Runs of the benchmark: what is measured again, what is kept, wrong usage."""

import json
from pathlib import Path
from typing import Any

import pytest
from bench_rows import FIELDS, made_up
from command_line import invoke

from comparisons.experiments.bench import run
from comparisons.experiments.bench.outputs import Display
from comparisons.experiments.bench.row import Row, Setting
from comparisons.experiments.bench.run import Group, all_groups, chosen
from reference_rt.util.errors import ReferenceUnavailableError, UsageError

SCENES = Path(__file__).parents[3] / "scenes"


class Counted:
    """A group of one row that counts how often it is measured."""

    def __init__(self, name: str, fails: Exception | None = None) -> None:
        self.group, self.count, self.fails = Group(name, (name,), self.measure), 0, fails

    def measure(self, setting: Setting) -> list[Row]:
        self.count += 1
        if self.fails is not None:
            raise self.fails
        setting.say("working", 0.5)
        return [made_up(self.group.name)]


@pytest.fixture
def setting(tmp_path: Path) -> Setting:
    scenes = tmp_path / "scenes"
    scenes.mkdir()
    (scenes / "one.yaml").write_text("shapes: []\n")
    return Setting(scenes=scenes)


@pytest.fixture
def groups(monkeypatch: pytest.MonkeyPatch) -> list[Counted]:
    counted = [Counted("first"), Counted("second")]
    monkeypatch.setattr(run, "all_groups", lambda setting: tuple(c.group for c in counted))
    return counted


def measured(groups: list[Counted], setting: Setting, out: Path, fresh: bool = False) -> Any:
    with Display() as display:
        return run.run([c.group for c in groups], setting, out, display, fresh)


def test_what_is_measured_is_not_measured_again(
    groups: list[Counted], setting: Setting, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    measured(groups[1:], setting, out)
    outcome = measured(groups, setting, out)
    assert [c.count for c in groups] == [1, 1]
    assert [row.name for row in outcome.rows] == ["first", "second"]
    assert outcome.met
    document = json.loads((out / "results.json").read_text())
    assert (document["schema"], document["kind"]) == (1, "bench")
    assert [row["name"] for row in document["rows"]] == ["first", "second"]
    assert all(set(row) >= FIELDS for row in document["rows"])
    assert document["machine"]["cores"] >= 1
    measured(groups, setting, out, fresh=True)
    assert [c.count for c in groups] == [2, 2]


def test_other_scenes_or_settings_are_measured_anew(
    groups: list[Counted], setting: Setting, tmp_path: Path
) -> None:
    measured(groups, setting, tmp_path / "out")
    measured(groups, Setting(scenes=setting.scenes, quick=True), tmp_path / "out")
    assert [c.count for c in groups] == [2, 2]
    (setting.scenes / "one.yaml").write_text("shapes: [] # changed\n")
    outcome = measured(groups[:1], setting, tmp_path / "out")
    assert [c.count for c in groups] == [3, 2]
    assert [row.name for row in outcome.rows] == ["first"]


def test_an_interruption_keeps_what_was_finished(
    groups: list[Counted], setting: Setting, tmp_path: Path
) -> None:
    groups[1].fails = KeyboardInterrupt()  # type: ignore[assignment]
    with pytest.raises(KeyboardInterrupt):
        measured(groups, setting, tmp_path / "out")
    document = json.loads((tmp_path / "out" / "results.json").read_text())
    assert [row["name"] for row in document["rows"]] == ["first"]
    groups[1].fails = None
    measured(groups, setting, tmp_path / "out")
    assert [c.count for c in groups] == [1, 2]


def test_without_mitsuba_the_other_rows_are_measured(
    groups: list[Counted], setting: Setting, tmp_path: Path
) -> None:
    groups[0].fails = ReferenceUnavailableError("Mitsuba is not installed")
    outcome = measured(groups, setting, tmp_path / "out")
    assert [row.name for row in outcome.rows] == ["second"]
    assert outcome.not_measured == {"first": "Mitsuba is not installed"}
    assert not outcome.met


@pytest.mark.parametrize("text", ["", "{}", '{"key": 1}', '{"rows": [{"x": 1}], "key": "k"}', "[]"])
def test_damaged_rows_are_measured_anew(tmp_path: Path, text: str) -> None:
    path = tmp_path / "rows.json"
    path.write_text(text)
    assert run.read_rows(path, "k") is None


def test_names_of_rows_are_distinguished_and_choose_their_groups() -> None:
    groups = all_groups(Setting(scenes=SCENES, quick=True))
    names = [row for group in groups for row in group.rows]
    assert len(set(names)) == len(names)
    assert chosen((), groups) == groups
    found = chosen(("mesh_*", "cornell_llvm", "cold_*"), groups)
    assert [group.name for group in found] == ["mesh_knot", "equal_samples", "cold"]
    with pytest.raises(UsageError, match="no row has the name 'speed'"):
        chosen(("threads", "speed"), groups)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--only", "speed"), "no row has the name 'speed'"),
        (("--mesh", "nowhere.ply"), "there is no file 'nowhere.ply'"),
        (("--markdown", "nowhere.md"), "cannot be read"),
    ],
)
def test_wrong_usage_is_reported_before_anything_is_measured(
    arguments: tuple[str, ...], message: str, tmp_path: Path
) -> None:
    result = invoke("bench", *arguments, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert message in result.stderr
    assert not (tmp_path / "out").exists()

"""The benchmark: its arithmetic on made-up times, its files, and the kernels pruned by hand."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from comparisons.bench import equal_error, mesh_rays, program, run, table
from comparisons.bench import timing as timing_module
from comparisons.bench.display import Display
from comparisons.bench.groups import GROUPS, Group, chosen
from comparisons.bench.machine import machine, vector_bits
from comparisons.bench.meshes import blob, write_obj, write_ply
from comparisons.bench.million_worker import peak, scene_of
from comparisons.bench.row import LIMIT, Row, against, row_from, within
from comparisons.bench.setting import Setting
from comparisons.bench.spheres_only import world_of
from comparisons.bench.timing import alternate, ratios, seconds, spread
from comparisons.bench.unused import render_pruned, spheres, with_everything
from reference_rt import query
from reference_rt.cli import _add_commands, app
from reference_rt.errors import ReferenceUnavailableError, UsageError
from reference_rt.film import BoxFilter, Film, TentFilter
from reference_rt.render import render
from reference_rt.scene import Scene
from reference_rt.shapes.mesh_files import read_mesh

SCENES = Path(__file__).parents[2] / "scenes"
FIELDS = {"name", "ours", "peer", "peer_name", "ratio", "goal", "spread", "unit", "better", "met"}


def made_up(name: str = "one", ratio: float = 0.5, goal: float = 0.8) -> Row:
    return against(name, f"the row {name}", [ratio] * 7, ("another", [1.0] * 7), goal)


# ---- arithmetic ---------------------------------------------------------------------------------


def test_a_spread_is_median_and_quartiles() -> None:
    assert spread([5.0, 1.0, 2.0, 4.0, 3.0]) == (2.0, 3.0, 4.0)
    with pytest.raises(ValueError, match="nothing"):
        spread([])


def test_ratios_are_taken_round_by_round() -> None:
    # The machine is ten times slower in one round, for both: the ratio does not see it.
    ours, peer = [1.0, 10.0, 1.1, 0.9, 1.0], [2.0, 20.0, 2.2, 1.8, 2.0]
    assert ratios(ours, peer) == pytest.approx((0.5, 0.5, 0.5), abs=1e-15)


def test_rounds_of_different_number_are_refused() -> None:
    with pytest.raises(ValueError, match="zip"):
        ratios([1.0], [1.0, 2.0])


def test_measures_alternate_and_every_other_round_is_reversed() -> None:
    calls: list[str] = []

    def measure(name: str) -> float:
        calls.append(name)
        return float(len(calls))

    told: list[tuple[str, float]] = []
    found = alternate(
        {"a": lambda: measure("a"), "b": lambda: measure("b")},
        3,
        lambda what, fraction: told.append((what, fraction)),
    )
    assert calls == ["a", "b", "b", "a", "a", "b"]
    assert found == {"a": [1.0, 4.0, 5.0], "b": [2.0, 3.0, 6.0]}
    assert [fraction for _, fraction in told] == pytest.approx([k / 6 for k in range(6)])


def test_a_linear_drift_favours_nobody() -> None:
    clock = iter(range(100))
    found = alternate({"a": lambda: next(clock) + 0.0, "b": lambda: next(clock) + 0.0}, 8)
    assert sum(found["a"]) == sum(found["b"])


def test_seconds_are_those_of_the_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([10.0, 12.5])
    monkeypatch.setattr(timing_module.time, "perf_counter", lambda: next(clock))
    assert seconds(lambda: None) == 2.5


# ---- rows ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("better", "ratio", "met"),
    [
        ("lower", 0.79, True),
        ("lower", 0.8, True),
        ("lower", 0.81, False),
        ("higher", 0.79, False),
        ("higher", 0.8, True),
        ("higher", 0.81, True),
        ("lower", math.nan, False),
        ("higher", math.nan, False),
    ],
)
def test_a_goal_is_met_on_its_side(better: Any, ratio: float, met: bool) -> None:
    row = against("x", "x", [ratio] * 7, ("y", [1.0] * 7), 0.8, better=better)
    assert row.met is met


def test_a_row_has_all_fields() -> None:
    ours, peer = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0], [2.0] * 7
    row = against("x", "what", ours, ("peer", peer), 2.0, unit="Mray/s", better="higher")
    document = row.as_json()
    assert set(document) >= FIELDS
    assert (row.ours, row.peer, row.ratio) == (4.0, 2.0, 2.0)
    assert row.spread == {"ours": [2.5, 5.5], "peer": [2.0, 2.0], "ratio": [1.25, 2.75]}
    assert document["met"] is True


def test_a_row_under_a_limit_is_a_ratio_to_it() -> None:
    row = within("x", "what", [3.0, 4.0, 5.0], 8.0, unit="MB")
    assert (row.ours, row.peer, row.peer_name, row.ratio, row.goal) == (4.0, 8.0, LIMIT, 0.5, 1.0)
    assert row.spread["ratio"] == [3.5 / 8.0, 4.5 / 8.0]
    assert row.met
    assert not within("x", "what", [8.1], 8.0).met


def test_a_row_survives_json() -> None:
    row = against("x", "what", [1.0] * 7, ("y", [3.0] * 7), 0.8, details={"a": {"b": [1, 2]}})
    assert row_from(json.loads(json.dumps(row.as_json(), allow_nan=False))) == row


def test_what_is_no_number_is_null() -> None:
    document = within("x", "what", [math.nan], 8.0, details={"inf": math.inf}).as_json()
    assert document["ours"] is None
    assert document["details"]["inf"] is None
    assert math.isnan(row_from(json.loads(json.dumps(document))).ours)


# ---- error at equal time ------------------------------------------------------------------------


def test_equal_error_takes_the_median_of_the_scenes_ratios() -> None:
    times = {
        "a": {"ours": 1.0, "mitsuba_llvm": 4.0, "mitsuba_llvm_best": 2.0},
        "b": {"ours": 1.0, "mitsuba_llvm": 2.0, "mitsuba_llvm_best": 1.0},
        "c": {"ours": 3.0, "mitsuba_llvm": 1.5},
        "d": {"mitsuba_llvm": 1.5},
    }
    median, worst, best = equal_error.rows(times, {"e": "why"})
    assert (median.ratio, median.met) == (0.5, True)
    assert (worst.ratio, worst.met, worst.details["worst"]) == (2.0, False, "c")
    assert (best.ratio, best.met) == (0.75, True)
    assert median.details["ratios"] == {"a": 0.25, "b": 0.5, "c": 2.0}
    assert median.details["left_out"] == {"e": "why"}


def test_who_never_reaches_the_error_takes_infinitely_long() -> None:
    never = math.inf
    times = {
        "a": {"ours": 1.0, "mitsuba_llvm": never, "mitsuba_llvm_best": never},
        "b": {"ours": never, "mitsuba_llvm": 1.0, "mitsuba_llvm_best": never},
        "c": {"ours": never, "mitsuba_llvm": never, "mitsuba_llvm_best": 1.0},
    }
    median, worst, best = equal_error.rows(times, {})
    assert median.details["ratios"] == {"a": 0.0, "b": never}
    assert not worst.met
    assert best.details["ratios"] == {"a": 0.0, "c": never}
    for row in (median, worst, best):
        again = row_from(json.loads(json.dumps(row.as_json(), allow_nan=False)))
        assert again.title in a_table([again])


def test_equal_error_of_nothing_meets_no_goal() -> None:
    assert not any(row.met for row in equal_error.rows({}, {}))


def test_only_path_traced_scenes_of_the_standard_suite_count() -> None:
    names = set(equal_error.path_traced(Setting(scenes=SCENES, quick=True)))
    assert names == set(equal_error.QUICK)


# ---- table --------------------------------------------------------------------------------------


def a_table(rows: list[Row]) -> str:
    return table.markdown(rows, machine(), {"cold": "no time"})


def test_the_table_says_what_when_and_where() -> None:
    text = a_table([made_up(), made_up("two|three", ratio=0.9)])
    assert f"Measured: {machine()['date'][:10]}" in text
    assert "| the row one | 0.5 s | 1 s (another) | 0.50 | 0.50 to 0.50 | ≤ 0.8 | yes |" in text
    assert "two\\|three" in text
    assert "Not measured: cold (no time)" in text


def test_rewriting_a_file_is_idempotent(tmp_path: Path) -> None:
    path = tmp_path / "README.md"
    path.write_text(f"before\n{table.BEGIN}\nformer\n{table.END}\nafter\n<!-- end -->\n")
    text = a_table([made_up()])
    table.rewrite(path, text)
    once = path.read_text()
    table.rewrite(path, text)
    assert path.read_text() == once
    assert once.startswith(f"before\n{table.BEGIN}\n")
    assert once.endswith(f"{table.END}\nafter\n<!-- end -->\n")
    assert "former" not in once
    assert "the row one" in once


@pytest.mark.parametrize("text", ["", f"{table.BEGIN}\n", f"{table.END}\n{table.BEGIN}\n"])
def test_a_file_without_markers_is_refused_and_kept(tmp_path: Path, text: str) -> None:
    path = tmp_path / "README.md"
    path.write_text(text)
    with pytest.raises(UsageError, match="no place for the table"):
        table.rewrite(path, "x\n")
    assert path.read_text() == text


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be read"):
        table.rewrite(tmp_path / "README.md", "x\n")


# ---- runs ---------------------------------------------------------------------------------------


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
    monkeypatch.setattr(run, "GROUPS", tuple(c.group for c in counted))
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


def test_names_of_rows_are_told_apart_and_choose_their_groups() -> None:
    names = [row for group in GROUPS for row in group.rows]
    assert len(set(names)) == len(names)
    assert chosen(()) == GROUPS
    assert [group.name for group in chosen(("cornell_llvm", "million_*"))] == [
        "equal_samples",
        "million",
    ]
    with pytest.raises(UsageError, match="no row is called 'speed'"):
        chosen(("threads", "speed"))


@pytest.fixture(scope="module")
def command() -> Any:
    if not any(c.name == "bench" for c in app.registered_commands):
        _add_commands()
    return lambda *arguments: CliRunner().invoke(app, ["bench", *arguments])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--only", "speed"), "no row is called 'speed'"),
        (("--mesh", "nowhere.ply"), "there is no file 'nowhere.ply'"),
        (("--markdown", "nowhere.md"), "cannot be read"),
    ],
)
def test_wrong_usage_is_told_before_anything_is_measured(
    command: Any, arguments: tuple[str, ...], message: str, tmp_path: Path
) -> None:
    result = command(*arguments, "--out", str(tmp_path / "out"))
    assert result.exit_code == 2
    assert message in result.stderr
    assert not (tmp_path / "out").exists()


# ---- what is measured ---------------------------------------------------------------------------


def small(scene: Scene) -> Scene:
    film = Film(width=24, height=16, filter=BoxFilter())
    return scene.changed(film=film, sampler=scene.resolved_sampler.model_copy(update={"spp": 8}))


def test_kernels_pruned_by_hand_give_the_same_bits() -> None:
    scene = small(spheres())
    ours, pruned = render(scene).colour, render_pruned(scene).colour
    assert np.array_equal(ours, pruned)
    assert 0.2 < ours.mean() < 1.0


@pytest.mark.slow
def test_with_everything_left_in_the_picture_is_the_same() -> None:
    scene = small(spheres())
    assert np.array_equal(render(with_everything(scene)).colour, render(scene).colour)


def test_kernels_pruned_by_hand_refuse_other_scenes() -> None:
    scene = spheres()
    with pytest.raises(ValueError, match="expected diffuse spheres"):
        world_of(scene.changed(film=Film(filter=TentFilter())))
    with pytest.raises(ValueError, match="expected diffuse spheres"):
        world_of(with_everything(scene))
    with pytest.raises(ValueError, match="so few"):
        world_of(scene.changed(hierarchy="sah"))


@pytest.mark.parametrize("write", [write_ply, write_obj])
def test_a_blob_is_closed_and_survives_its_file(tmp_path: Path, write: Any) -> None:
    mesh = blob(1000)
    assert 1000 <= len(mesh.faces) < 1300
    corners = mesh.vertices[mesh.faces]
    volumes = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    assert np.all(volumes > 0.0)  # counter-clockwise everywhere: seen from inside nothing is
    path = tmp_path / f"blob.{write.__name__.removeprefix('write_')}"
    write(path, mesh)
    read = read_mesh(path)
    expected = mesh.vertices.astype("f4")[mesh.faces]
    assert np.array_equal(read.vertices[read.faces].astype("f4"), expected)


def test_coherent_rays_see_the_mesh_and_incoherent_ones_cross_it() -> None:
    vertices = blob(1000).vertices
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    center, radius = (lower + upper) / 2.0, np.linalg.norm(upper - lower) / 2.0

    def distance(o: Any, d: Any) -> Any:
        return np.linalg.norm(np.cross(center - o, d), axis=1)

    o, d = mesh_rays.coherent(vertices, 32)
    assert len(o) == len(d) == 1024
    assert distance(o, d).min() < 0.1 * radius
    assert np.sum(d * np.roll(d, 1, axis=0), axis=1)[1:32].min() > 0.999  # neighbours in a row
    o, d = mesh_rays.incoherent(vertices, 500)
    assert np.linalg.norm(o - center, axis=1) == pytest.approx(np.full(500, radius))
    assert distance(o, d).max() < radius
    o, d, length = mesh_rays.chords(vertices, 500)
    assert np.linalg.norm(o + d * length[:, None] - center, axis=1) == pytest.approx(
        np.full(500, radius)
    )
    assert np.linalg.norm(d, axis=1) == pytest.approx(np.ones(500))


def test_closest_is_what_intersect_finds_on_any_number_of_threads(tmp_path: Path) -> None:
    path = tmp_path / "blob.ply"
    write_ply(path, blob(300))
    tables = scene_of(path).tables
    rays = mesh_rays.incoherent(blob(300).vertices, 40_000)  # three blocks
    one, two = (query.closest(tables, *rays, threads=n) for n in (1, 2))
    full = query.intersect(tables, *rays)
    for field in ("t", "kind", "row", "uv"):
        assert np.array_equal(getattr(one, field), getattr(two, field))
    assert np.array_equal(one.t, full.t)
    assert np.array_equal(one.kind < 0, full.shape < 0)
    assert 0.2 < np.mean(one.kind >= 0) < 0.9
    shadows = query.occluded(tables, *rays, threads=2)
    assert np.array_equal(shadows, one.kind >= 0)


def test_the_program_tells_its_times(tmp_path: Path) -> None:
    found = program.Program(tmp_path).render(SCENES / "whitted_classic.yaml")
    assert found["wall"] > found["render"] > 0.0
    assert set(found) == {"wall", "build", "compile", "render"}


def test_a_program_that_fails_is_told(tmp_path: Path) -> None:
    with pytest.raises(Exception, match=r"nowhere\.yaml"):
        program.Program(tmp_path).render(tmp_path / "nowhere.yaml")


def test_the_machine_is_described() -> None:
    facts = machine()
    assert facts["cores"] >= 1
    assert vector_bits() in (128, 256, 512, None)
    assert {"machine", "system", "python", "numba", "memory_gib", "date"} <= set(facts)


def test_peak_memory_is_in_megabytes() -> None:
    before = peak()
    block = np.ones(40_000_000)  # 320 MB
    assert peak() >= before
    assert peak() > block.nbytes / 1e6

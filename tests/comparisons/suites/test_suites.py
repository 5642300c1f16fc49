"""Suites: their files, which cases are run and which results are reused."""

import json

import pytest
from suite_runs import NOISY, RAY_CAST, SCENES, processes, run_in, scenes, suite

from comparisons.compare.budget import Budget
from comparisons.mitsuba.backend import Backend
from comparisons.results.case import exit_code
from comparisons.results.stored_case import read_case
from comparisons.suites.keys import case_key, files_digest
from comparisons.suites.suite import BUILT_IN, Changes, load_suite, parse_suite, plan
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import SceneError, UsageError

pytestmark = pytest.mark.usefixtures("fake_runners")


# ---- suite files --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("about: x\nscenes:\n  a: {sp: 4}\n", "s.yaml:3: scenes.a.sp: unknown key"),
        ("about: x\nscenes:\n  a:\n    spp: 0\n", "s.yaml:4: scenes.a.spp: expected greater"),
        ("about: x\ndefaults:\n  limit: -1\n", "s.yaml:3: defaults.limit: expected greater"),
        ("about: x\n\nscenes: {a: {size: [3]}}\n", "s.yaml:3: scenes.a.size"),
        ("about: x\nscenes:\n  a: {skip: ''}\n", "s.yaml:3: scenes.a.skip"),
        ("about: x\nscenes:\n  a: {control: true}\n", "s.yaml:3: scenes.a.control: cannot be set"),
        ("defaults: {}\n", "s.yaml:1: about: missing"),
        ("about: x\nabout: y\n", "s.yaml:2: malformed"),
        ("about: [\n", "s.yaml:2: malformed"),
        ("- a\n", "s.yaml:1: expected keys"),
        ("", "s.yaml:1: expected keys"),
        ("about: x\ncase_seconds: .nan\n", "s.yaml:2: case_seconds: expected"),
    ],
)
def test_a_wrong_suite_is_reported_with_its_line(text, expected):
    with pytest.raises(SceneError) as error:
        parse_suite(text, "s.yaml")
    assert str(error.value).startswith(expected)
    assert "\n" not in str(error.value)


def test_a_suite_may_be_a_file_of_ones_own(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("about: mine\n")
    assert load_suite(str(path)).name == "mine"
    with pytest.raises(UsageError, match="there is no suite 'huge'; expected smoke, standard"):
        load_suite("huge")
    with pytest.raises(SceneError, match="cannot be read"):
        load_suite(str(tmp_path / "none.yaml"))
    path.write_bytes(b"\xff\xfe\xfa")
    with pytest.raises(SceneError, match="is UTF-16; expected UTF-8"):
        load_suite(str(path))


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_suites_fit_the_scenes(name):
    """Every scene is compared, or it is said why not, and none is named that is not there."""
    source = load_suite(name)
    planned = plan(source, SCENES)
    names = {work.name for work in planned.work} | set(planned.skipped)
    assert {path.stem for path in SCENES.glob("*.yaml")} <= names
    assert all(len(why) > 10 for why in planned.skipped.values())


# ---- what is run --------------------------------------------------------------------------------


def test_a_scene_that_is_not_named_has_the_defaults(tmp_path):
    scenes(scenes(tmp_path, "a", "b", "d"), "c", text=NOISY)
    planned = plan(
        suite("""
about: x
defaults: {spp: 8, replicates: 4}
scenes:
  a: {spp: 16}
  d: {skip: it is not needed}
controls:
  defaults: {spp: 2}
"""),
        tmp_path,
    )
    assert {work.name: work.budget for work in planned.work} == {
        "a": Budget(spp=16, replicates=4),
        "b": Budget(spp=8, replicates=4),
        "c": Budget(spp=8, replicates=4),
        **{f"{name} (control)": Budget(spp=2, control=True) for name in "abcd"},
    }
    assert planned.skipped == {"d": "it is not needed"}


def test_controls_may_be_of_some_scenes_only(tmp_path):
    scenes(tmp_path, "a", "b", text=NOISY)
    text = "about: x\ncontrols: {only: [b]}\n"
    assert [work.name for work in plan(suite(text), tmp_path).work] == ["a", "b", "b (control)"]
    with pytest.raises(SceneError, match=r"test\.yaml:2: controls\.only\[0\]: there is no scene"):
        plan(suite(text.replace("[b]", "[z]")), tmp_path)


def test_a_scene_that_is_named_must_be_there(tmp_path):
    scenes(tmp_path, "a")
    text = "about: x\nscenes:\n  a: {}\n  other: {}\n"
    with pytest.raises(SceneError) as error:
        plan(suite(text), tmp_path)
    assert str(error.value).startswith("test.yaml:4: scenes.other: there is no scene 'other'")


@pytest.mark.parametrize(
    ("patterns", "expected"),
    [
        (("a*",), ["aa", "aa (control)", "ab", "ab (control)"]),
        (("ab", "b"), ["ab", "b"]),
        (("*(control)",), ["aa (control)", "ab (control)", "b (control)"]),
        (("b*",), ["b", "b (control)"]),
    ],
)
def test_only_those_that_fit_a_pattern(tmp_path, patterns, expected):
    scenes(scenes(tmp_path, "aa", "ab"), "b", text=NOISY)
    planned = plan(suite("about: x\ncontrols: {}\n"), tmp_path, patterns)
    assert [work.name for work in planned.work] == expected


MITSUBA = """<scene version="3.0.0"><default name="spp" value="4"/><integrator type="path"/>
<sensor type="perspective"><sampler type="independent">
<integer name="sample_count" value="$spp"/></sampler></sensor><shape type="sphere"/></scene>"""


def test_defaults_are_for_scenes_of_mitsuba(tmp_path):
    folder = scenes(tmp_path, "a", text=NOISY)
    (tmp_path / "b.xml").write_text(MITSUBA)
    changes = Changes(defaults={"spp": "9"})
    planned = plan(suite("about: x\n"), folder, changes=changes)
    ours, theirs = planned.work
    assert isinstance(ours.scene, Scene)
    assert ours.changes.defaults == {}
    assert theirs.scene.resolved_sampler.spp == 9
    assert theirs.changes.load(theirs.path).resolved_sampler.spp == 9
    assert plan(suite("about: x\n"), folder).work[1].scene.resolved_sampler.spp == 4


def test_nothing_to_run_is_no_success(tmp_path):
    scenes(tmp_path, "a")
    with pytest.raises(UsageError, match=r"nothing to run: no case matches z\*"):
        plan(suite(), tmp_path, ("z*",))
    with pytest.raises(UsageError, match="holds no scene"):
        plan(suite(), scenes(tmp_path / "empty"))
    with pytest.raises(UsageError, match="there is no folder"):
        plan(suite(), tmp_path / "none")


@pytest.mark.slow
def test_only_some_rungs(tmp_path):
    folder = scenes(tmp_path / "scenes", "a", "b")
    found = run_in(tmp_path / "out", folder, rungs=("whitted",))
    assert found.cases == ()
    assert found.not_run == dict.fromkeys("ab", "the rung whitted does not apply")
    assert exit_code(found.cases) == 4
    found = run_in(tmp_path / "out", folder, rungs=("whitted", "geometry"))
    assert [case.scene for case in found.cases] == ["a", "b"]


def test_controls_are_of_pictures_only(tmp_path):
    scenes(tmp_path, "a", text=NOISY)
    source = suite("about: x\ncontrols: {}\n")
    assert len(plan(source, tmp_path, rungs=("geometry",)).work) == 1
    assert len(plan(source, tmp_path, rungs=("geometry", "statistics")).work) == 2


# ---- what is not run again ----------------------------------------------------------------------


@pytest.mark.slow
def test_what_is_done_is_not_done_again(tmp_path):
    folder, out = scenes(tmp_path / "scenes", "a", "differ"), tmp_path / "out"
    first = run_in(out, folder)
    assert [case.verdict for case in first.cases] == ["agree", "differ"]
    assert processes(run_in(out, folder)) == processes(first)
    (folder / "a.yaml").write_text(RAY_CAST + "film: {width: 8, height: 8}\n")
    second = processes(run_in(out, folder))
    assert second["differ"] == processes(first)["differ"]
    assert second["a"] != processes(first)["a"]
    third = processes(run_in(out, folder, "about: x\ndefaults: {pixels: 99}\n"))
    assert not set(third.values()) & set(second.values())
    fresh = processes(run_in(out, folder, "about: x\ndefaults: {pixels: 99}\n", fresh=True))
    assert not set(fresh.values()) & set(third.values())
    told = json.loads((out / "results.json").read_text())
    assert [case["scene"] for case in told["cases"]] == ["a", "differ"]
    assert told["suite"] == "test"
    assert "differ" in (out / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_damaged_record_is_made_again(tmp_path):
    folder, out = scenes(tmp_path / "scenes", "a"), tmp_path / "out"
    first = run_in(out, folder)
    (out / "cases" / "a" / "pictures.exr").write_bytes(b"v/1\x01")
    second = run_in(out, folder)
    assert processes(first) != processes(second)
    assert read_case(out / "cases" / "a").images is not None


def test_keys_report_what_a_case_is_made_with(tmp_path):
    (tmp_path / "bitmap.png").write_bytes(b"1")
    (tmp_path / "s.yaml").write_text("textures: {t: {type: bitmap, file: bitmap.png}}\n")

    def key(variant="llvm_ad_rgb", rungs=(), **budget):
        scene = Scene.load(tmp_path / "s.yaml")
        return case_key(scene, Budget(**budget), rungs, Backend(variant, "0", "", None))

    keys = [key(), key("scalar_rgb"), key(rungs=("film",)), key(spp=3), key(control=True)]
    (tmp_path / "bitmap.png").write_bytes(b"2")
    keys.append(key())
    (tmp_path / "s.yaml").write_text("textures: {t: {type: bitmap, file: ./bitmap.png}}\n")
    keys.append(key())
    assert len(set(keys)) == len(keys)
    assert key() == keys[-1]
    (tmp_path / "bitmap.png").unlink()
    with pytest.raises(SceneError, match=r"bitmap\.png: cannot be read"):
        key()


def test_keys_cover_the_parts_of_a_mesh(tmp_path):
    (tmp_path / "m.gltf").write_text(json.dumps({"buffers": [{"uri": "m%20x.bin"}, {}]}))
    (tmp_path / "m x.bin").write_bytes(b"1")
    (tmp_path / "s.yaml").write_text("shapes: [{type: mesh, file: m.gltf}]\n")
    scene = Scene.load(tmp_path / "s.yaml")
    before = files_digest(scene)
    (tmp_path / "m x.bin").write_bytes(b"2")
    assert files_digest(scene) != before

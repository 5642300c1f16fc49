"""A scene that is invalid is a case that says so, with file and line; all others are compared."""

import json

import pytest
from junitparser import JUnitXml
from suite_runs import RAY_CAST, run_in, scenes

from comparisons.results.case import exit_code
from comparisons.suites.keys import files_digest
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import SceneError

pytestmark = pytest.mark.usefixtures("fake_runners")

BALL = "shapes:\n  - {type: sphere}\n"
MISSING_FILES = {
    "mesh": (BALL + "  - type: mesh\n    file: none.ply\n", 4, "shapes[1].file"),
    "operand": (
        BALL + "  - {type: union, of: [\n      {type: sphere},\n      {type: mesh,\n"
        "       file: none.ply}]}\n",
        6,
        "shapes[1].of[1].file",
    ),
    "group": (
        "groups:\n  g:\n    - {type: sphere}\n    - {type: mesh, file: none.obj}\n"
        "shapes: [{type: instance, group: g}]\n",
        4,
        "groups.g[1].file",
    ),
    "texture": ("textures:\n  t: {type: bitmap, file: none.png}\n", 2, "textures.t.file"),
    "sky": ("lights:\n  - {type: environment_map, file: none.exr}\n", 2, "lights[0].file"),
}
"""Text, line and keys, by what is missing."""

MALFORMED = {
    "yaml": ("shapes: [\n", "malformed"),
    "value": (BALL + "  - {type: sphere, radius: -1}\n", "shapes[1].radius: expected greater"),
    "key": (BALL + "film: {widht: 3}\n", "film.widht: unknown key"),
    "empty": ("", "expected keys"),
}


@pytest.mark.parametrize("what", MISSING_FILES)
def test_a_missing_file_is_reported_with_its_line(what, tmp_path):
    text, line, keys = MISSING_FILES[what]
    (tmp_path / "s.yaml").write_text(text)
    scene = Scene.load(tmp_path / "s.yaml")
    with pytest.raises(SceneError) as error:
        files_digest(scene)
    assert str(error.value).startswith(f"{tmp_path / 's.yaml'}:{line}: {keys}: "), error.value
    with pytest.raises(SceneError, match="none") as error:
        _ = scene.tables
    assert f": {keys.partition('.of')[0].removesuffix('.file')}" in str(error.value)


@pytest.fixture
def folder(tmp_path):
    """Scenes of which three are valid; the others are invalid in every way."""
    folder = scenes(tmp_path / "scenes", "a", "differ", "z")
    for what, (text, *_) in MISSING_FILES.items():
        (folder / f"missing_{what}.yaml").write_text(RAY_CAST + text)
    for what, (text, _) in MALFORMED.items():
        (folder / f"malformed_{what}.yaml").write_text(text)
    (folder / "binary.yaml").write_bytes(b"\xfa\xfb\xfe")
    (folder / "folder.yaml").mkdir()
    (folder / "rubbish.ply").write_bytes(b"ply\nnothing")
    mesh = RAY_CAST + BALL + "  - {type: mesh, file: rubbish.ply}\n"
    (folder / "tables_mesh.yaml").write_text(mesh)
    (folder / "rubbish.png").write_bytes(b"\x89PNG")
    image = RAY_CAST + "textures:\n  t: {type: bitmap, file: rubbish.png}\n"
    image += "materials: {m: {type: diffuse, reflectance: t}}\n"
    image += "shapes: [{type: sphere, material: m}]\n"
    (folder / "tables_image.yaml").write_text(image)
    return folder


def expected(folder):
    """How the reason of each invalid case begins, by the case's name."""
    found = {
        f"missing_{what}": f"{folder}/missing_{what}.yaml:{line + 1}: {keys}"
        for what, (_, line, keys) in MISSING_FILES.items()
    }
    found |= {f"malformed_{what}": f"{folder}/malformed_{what}.yaml" for what in MALFORMED}
    found |= {
        "binary": f"{folder}/binary.yaml: is not text",
        "folder": f"{folder}/folder.yaml: cannot be read: Is a directory",
        "tables_mesh": f"{folder}/tables_mesh.yaml:4: shapes[1]",
        "tables_image": f"{folder}/tables_image.yaml:3: textures.t",
    }
    return found


def check(cases, folder, more):
    """All cases but the three valid ones say what is wrong with their scenes."""
    reasons = {case.scene: case.reason for case in cases if case.verdict == "invalid"}
    wanted = expected(folder) | more
    assert set(reasons) == set(wanted)
    for name, begin in wanted.items():
        assert reasons[name].startswith(f"scene: {begin}"), reasons[name]
    for what, (_, told) in MALFORMED.items():
        assert told in reasons[f"malformed_{what}"]
    verdicts = {case.scene: case.verdict for case in cases}
    assert (verdicts["a"], verdicts["differ"], verdicts["z"]) == ("agree", "differ", "agree")


@pytest.mark.slow
def test_a_suite_runs_the_other_scenes(tmp_path, folder, program):
    (folder / "z.json").write_text("{}")  # the name of z.yaml, which comes after it
    mine, out, junit = tmp_path / "mine.yaml", tmp_path / "out", tmp_path / "junit.xml"
    mine.write_text("about: mine\n")
    common = ("suite", mine, "--scenes", folder, "--out", out)
    result = program(*common, "--junit", junit)
    double = {"z.yaml": f"{folder}/z.yaml: has the same name as z.json; expected a unique name"}
    check(program.found.cases, folder, double)
    assert result.exit_code == 3, result.output
    number = len(expected(folder)) + 1
    assert f"{number + 3} cases: {number} invalid, 2 agree, 1 differ" in result.stderr
    (tests,) = JUnitXml.fromfile(str(junit))
    assert (tests.tests, tests.errors, tests.failures) == (number + 3, number, 1)
    told = json.loads((out / "results.json").read_text())
    assert (told["asked"], told["missing"]) == (number + 3, [])
    by_name = {case["scene"]: case for case in told["cases"]}
    assert by_name["missing_mesh"]["tiers"]["scene"]["status"] == "invalid"
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "missing_mesh.yaml:5: shapes[1].file" in page
    # Once its scene is mended, only that case is run.
    (folder / "missing_mesh.yaml").write_text(RAY_CAST + BALL)
    result = program(*common)
    assert {c.scene: c.verdict for c in program.found.cases}["missing_mesh"] == "agree"
    assert "a: agree (done before)" in result.stderr


@pytest.mark.slow
def test_so_does_compare(tmp_path, folder, program):
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "a.yaml").write_text(RAY_CAST)
    files = sorted(folder.glob("*.yaml"))
    files += [tmp_path / "other" / "a.yaml", folder / "nowhere.yaml", folder / "rubbish.png"]
    result = program("compare", *files, files[0], "--out", tmp_path / "out")
    more = {
        "nowhere": f"{folder}/nowhere.yaml: cannot be read: No such file",
        "rubbish": f"{folder}/rubbish.png: is not a scene file",
    }
    check(program.found.cases, folder, more)
    assert result.exit_code == 3, result.output
    names = [case.scene for case in program.found.cases]
    assert names == [*(path.stem for path in files[:-3]), "a (2)", "nowhere", "rubbish"]
    assert (tmp_path / "out" / "cases" / "a.2" / "case.json").exists()
    again = {case.scene: case.again for case in program.found.cases}["a (2)"]
    assert again == f"reference-rt compare {tmp_path}/other/a.yaml --fresh"


@pytest.mark.slow
def test_the_command_line_changes_each_scene(tmp_path, program):
    """Samples, size and seed are part of what a case is made with."""
    folder, out = scenes(tmp_path / "scenes", "a", text="integrator: {type: path}\n"), "out"
    common = ("compare", folder / "a.yaml", "--out", tmp_path / out)
    pids = set()
    for more in ((), ("--spp", 8), ("--size", "8x4"), ("--seed", 5), ("--replicates", 4)):
        result = program(*common, *more)
        assert result.exit_code == 0, result.output
        pids.add(program.found.cases[0].rungs[0].numbers["process"])
        result = program(*common, *more)
        assert "done before" in result.stderr
        pids.add(program.found.cases[0].rungs[0].numbers["process"])
    assert len(pids) == 5
    result = program(*common, "--replicates", 4, "--fresh")
    assert program.found.cases[0].rungs[0].numbers["process"] not in pids
    assert program(*common, "--spp", 0).exit_code == 2


@pytest.mark.slow
def test_where_a_case_could_not_run_as_well_that_counts(tmp_path):
    folder = scenes(tmp_path / "scenes", "a", "raise", "scene_error")
    assert exit_code(run_in(tmp_path / "out", folder).cases) == 4


@pytest.mark.slow
def test_warnings_about_a_scene_are_reported_with_its_case(tmp_path, program):
    """The worker that reads the scene has no terminal."""
    folder = scenes(tmp_path / "scenes", "warn")
    for _ in range(2):  # the second time from the record
        result = program("compare", folder / "warn.yaml", "--out", tmp_path / "out")
        warning = f"warning: {folder}/warn.yaml:1: integrator: is odd"
        assert result.stderr.count(warning) == 1
        assert program.found.cases[0].notes[0] == warning

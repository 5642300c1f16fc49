"""Defaults of commands from a project's pyproject.toml."""

from pathlib import Path

import pytest
from command_line import SCENE, invoke

from reference_rt.cli.defaults import find
from reference_rt.util.errors import MOST_TOLD


@pytest.fixture
def project(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(text: str) -> None:
    Path("pyproject.toml").write_text(text)


def test_a_table_has_the_options_of_its_command(project: Path) -> None:
    write("[tool.reference_rt.trace]\npixel = '0,99999'\n[tool.reference_rt.render]\nspp = 1\n")
    result = invoke("trace", SCENE)
    assert "99999" in result.stderr  # which the picture has not
    # The command line is stronger.
    assert "99999" not in invoke("trace", SCENE, "--pixel", "0,77777").stderr


def test_paths_are_relative_to_the_file(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write('[tool.reference_rt.convert]\noutput = "made/x.json"\n')
    inside = project / "a" / "b"
    inside.mkdir(parents=True)
    monkeypatch.chdir(inside)
    result = invoke("convert", SCENE)
    assert result.exit_code == 0, result.output
    assert [path.name for path in (project / "made").iterdir()] == ["x.json"]
    # The nearest file with such a section counts.
    (inside / "pyproject.toml").write_text("[tool.other]\n")
    (project / "made" / "x.json").unlink()
    assert invoke("convert", SCENE).exit_code == 0
    (project / "a" / "pyproject.toml").write_text('[tool.reference_rt.convert]\noutput = "y.json"')
    assert invoke("convert", SCENE).exit_code == 0
    assert (project / "a" / "y.json").exists()


@pytest.mark.parametrize(
    ("table", "option"),
    [
        ("gate", "command = 'touch x'"),
        ("gate", "pair = ['touch x', 'touch y']"),
        ("gate", "browser = true"),
        ("fuzz", "renderer = 'touch x'"),
        ("render", "scheduler = 'tcp://127.0.0.1:8786'"),
        ("render", "cluster = 'cluster.yaml'"),
    ],
)
def test_what_runs_programs_is_refused(project: Path, table: str, option: str) -> None:
    """Who renders a stranger's scene in its folder has not asked for it."""
    write(f"[tool.reference_rt.{table}]\n{option}\n")
    result = invoke(table, *([] if table == "fuzz" else [SCENE]))
    assert result.exit_code == 2
    assert "expected on the command line alone" in result.stderr
    assert not Path("x").exists()


def test_paths_stay_within_the_folder(
    project: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    Path("linked").symlink_to(elsewhere, target_is_directory=True)
    for path in (f"{elsewhere}/x.json", "../x.json", "a/../../x.json", "linked/x.json"):
        write(f"[tool.reference_rt.convert]\noutput = '{path}'\n")
        result = invoke("convert", SCENE)
        assert result.exit_code == 2, path
        assert "expected a path within the file's folder" in result.stderr
    assert not [*elsewhere.iterdir()]


def test_the_file_of_a_named_picture_is_a_path_too(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`--beside NAME=FILE`."""
    inside = project / "a"
    inside.mkdir()
    monkeypatch.chdir(inside)
    file = project / "pyproject.toml"
    file.write_text("[tool.reference_rt.gate]\nbeside = ['Cycles=none.exr']\n")
    words = ("gate", "none.npy", "--reference", "none.npy")
    assert f"{Path('..', 'none.exr')}: there is no such file" in invoke(*words).stderr
    file.write_text("[tool.reference_rt.gate]\nbeside = ['Cycles=/elsewhere/c.exr']\n")
    assert "expected a path within the file's folder" in invoke(*words).stderr


def test_a_file_that_may_not_be_read_is_passed_by(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write("[tool.reference_rt.check]\nallow-missing = 'x'\n")

    def refused(path: Path) -> bytes:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_bytes", refused)
    assert find(project) is None


def test_what_all_commands_have_stands_in_the_section(project: Path) -> None:
    write("[tool.reference_rt]\nthreads = 0\n")
    told = "tool.reference_rt.render.threads: "
    assert told in invoke("render", SCENE, "-o", "x.exr").stderr  # at least 1 is expected
    assert invoke("check", SCENE).exit_code == 0  # has no threads


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            "[tool.reference_rt.rendr]\nspp = 1",
            "tool.reference_rt.rendr: is no command; ",
        ),
        ("[tool.reference_rt]\nspp = 1", "tool.reference_rt.spp: is no command"),
        ("[tool.reference_rt.check]\nspp = 1", "tool.reference_rt.check.spp: is no option; expec"),
        ("[tool.reference_rt]\ncheck = 1", "tool.reference_rt.check: expected a table"),
        ("[tool.reference_rt.check]\nallow-missing = 'x'", "check.allow-missing: "),
        ("[tool.reference_rt.check]\nallow-missing = ", "pyproject.toml: cannot be read: "),
        ("[tool]\nreference_rt = 1 # tool.reference_rt", "tool.reference_rt: expected a table"),
    ],
)
def test_what_is_wrong_is_told(project: Path, text: str, told: str) -> None:
    write(text)
    result = invoke("check", SCENE)
    assert result.exit_code == 2
    assert told in result.stderr
    assert "pyproject.toml" in result.stderr


def test_check_prints_every_error_of_every_file(project: Path) -> None:
    Path("a.yaml").write_text("camera: {type: fisheye}\nfilm: {width: -1}\n")
    Path("b.yaml").write_text("""
materials: {m: {type: diffuse}}
shapes: [{type: mesh, file: none.ply, material: m}]
lights: [{type: constant, radiance: 1}]
""")
    result = invoke("check", "a.yaml", SCENE, "b.yaml", "none.yaml")
    assert result.exit_code == 3
    for told in ("a.yaml:1: ", "a.yaml:2: ", "b.yaml:3: ", "none.ply", "none.yaml"):
        assert told in result.stderr, told
    assert Path(SCENE).name not in result.stderr
    assert invoke("check", SCENE).exit_code == 0


def test_check_tells_all_names_and_all_files_at_once(project: Path) -> None:
    Path("names.yaml").write_text("""
textures: {t: {type: product, of: [none, none]}}
materials: {a: {type: diffuse, reflectance: t2}, b: {type: bump, base: c, height: t}}
shapes:
  - {type: sphere, material: nothing}
  - {type: instance, group: g}
groups: {h: [{type: sphere, interior: fog}]}
camera: {type: perspective, medium: smoke}
lights: [{type: constant, radiance: 1}, {type: constant, radiance: 1}]
""")
    result = invoke("check", "names.yaml")
    assert result.exit_code == 3
    for line in (2, 3, 5, 6, 7, 8, 9):
        assert f"names.yaml:{line}: " in result.stderr, line
    assert result.stderr.count("names.yaml:3: ") == 2
    Path("files.yaml").write_text("""
textures: {t: {type: bitmap, file: a.png}, u: {type: bitmap, file: b.png}}
materials: {m: {type: diffuse, reflectance: t}, n: {type: diffuse, reflectance: u}}
groups: {g: [{type: mesh, file: c.ply}]}
shapes:
  - {type: mesh, file: d.obj, material: m}
  - {type: instance, group: g}
  - {type: instance, group: g}
  - {type: sphere, material: n}
  - {type: mesh, file: e.stl}
""")
    for words in (("check", "files.yaml"), ("render", "files.yaml", "-o", "x.png")):
        result = invoke(*words)
        assert result.exit_code == 3
        for file in ("a.png", "b.png", "c.ply", "d.obj", "e.stl"):
            assert result.stderr.count(file) == 1, file
    many = "shapes:\n" + "- {type: sphere, material: nothing}\n" * 500
    Path("many.yaml").write_text(many)
    assert invoke("check", "many.yaml").stderr.count("nothing") == MOST_TOLD

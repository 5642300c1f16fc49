"""Defaults of commands from a project's pyproject.toml."""

import inspect
import re
from pathlib import Path
from typing import get_args

import pytest
from command_line import COMMANDS, SCENE, invoke
from typer.core import TyperGroup
from typer.main import get_command
from typer.models import OptionInfo

from reference_rt.cli.defaults import IN_TEXTS, NEVER, find, of_command
from reference_rt.cli.main import app
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


@pytest.mark.parametrize(
    ("table", "option", "value", "seen"),
    [
        ("gate", "tone_curve", "curve.txt", "../curve.txt"),
        ("gate", "tone-curve", "curve.txt:0.5", "../curve.txt:0.5"),
        ("gate", "tone-curve", "here", "../here"),  # no suffix, but there is such a file
        ("gate", "tone-curve", "here:2e-1", "../here:2e-1"),
        ("gate", "tone-curve", "aces:0.5", "aces:0.5"),
        ("gate", "beside", ["Cycles=c.exr", "b=a/here"], ["Cycles=../c.exr", "b=here"]),
        ("preview", "to", "x.png", "../x.png"),
        ("preview", "to", "sixel", "sixel"),
        ("versions", "scene", ["my.yaml", "cornell_box"], ["../my.yaml", "cornell_box"]),
        ("gate", "reference", ["r.exr"], ["../r.exr"]),
    ],
)
def test_paths_in_texts_are_relative_to_the_file(
    project: Path,
    monkeypatch: pytest.MonkeyPatch,
    table: str,
    option: str,
    value: object,
    seen: object,
) -> None:
    write(f"[tool.reference_rt.{table}]\n{option} = {value!r}\n")
    Path("here").touch()
    Path("a").mkdir()
    monkeypatch.chdir("a")
    group = get_command(app)
    assert isinstance(group, TyperGroup)
    file = find(Path.cwd())
    assert file is not None
    context = group.make_context("reference-rt", ["doctor"], resilient_parsing=True)
    found = of_command(file, table, group.commands, context, complete=True)
    assert [*found.values()] == [seen]


def test_every_text_that_may_name_a_file_is_known() -> None:
    """By what its help says."""
    found = set()
    for command in COMMANDS.values():
        for parameter in inspect.signature(command, eval_str=True).parameters.values():
            kind, *about = get_args(parameter.annotation)
            is_text = bool(about) and isinstance(about[0], OptionInfo) and "str" in str(kind)
            if is_text and re.search(r"\bfile\b", about[0].help or ""):
                found.add(parameter.name.replace("_", "-"))
    assert found >= {"tone-curve", "to", "scene"}
    assert found <= NEVER | IN_TEXTS.keys() | {"define"}  # -D is no option of a table


def test_what_a_text_names_stays_within_the_folder(project: Path) -> None:
    for value in ("../curve.txt", "/curve.txt:2", "a/../../x", ".."):
        write(f"[tool.reference_rt.gate]\ntone-curve = '{value}'\n")
        result = invoke("gate", "a.npy", "--reference", "b.npy")
        assert "expected a path within the file's folder" in result.stderr, value


@pytest.mark.parametrize(
    "text",
    [
        "[tool]\nreference_rt = {check = {spp = 1}}",
        "[tool]\nreference_rt.check.spp = 1",
        "[ tool . reference_rt . check ]\nspp = 1",
        "[tool.'reference_rt'.\"check\"]\nspp = 1",
        "tool = {reference_rt = {check = {spp = 1}}}",
        "tool.reference_rt.check.spp = 1",
        "[tool.reference_rt]\ncheck.spp = 1",
    ],
)
def test_a_section_is_found_in_any_notation_of_toml(project: Path, text: str) -> None:
    write(text)
    assert "tool.reference_rt.check.spp: is no option" in invoke("check", SCENE).stderr


@pytest.mark.parametrize(
    "text",
    [
        "tool = 1 # reference_rt",
        "# [tool.reference_rt]\n",
        "[project]\ndependencies = ['reference_rt']\n# see tool.reference_rt\n",
        "[project]\ndependencies = ['reference_rt'\n",  # no TOML, but no section of ours either
        "[tool.reference_rt_too]\ncheck = 1\n",
    ],
)
def test_a_file_without_a_section_is_passed_by(project: Path, text: str) -> None:
    write(text)
    assert find(project) is None


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

"""All problems of a scene at once, and names that were nearly right."""

import pytest
from typer.testing import CliRunner

import reference_rt as rt
from reference_rt.cli.main import app
from reference_rt.core.diagnosis import MOST

BAD = """\
camera: {type: perspectiv, fov: 40}
film:
  widht: 320
  height: -1
materials:
  floor: {type: diffuse, reflectance: [1, 2]}
shapes:
  - {type: sphere, radius: big}
  - {type: sphere, radius: 1, centre: [0, 0, 0]}
"""
FOUND = [
    (1, ("camera",), "did you mean 'perspective'?"),
    (3, ("film", "widht"), "did you mean 'width'?"),
    (4, ("film", "height"), "greater than or equal to 1, got -1"),
    (6, ("materials", "floor", "reflectance"), "expected"),
    (8, ("shapes", 0, "radius"), "got 'big'"),
    (9, ("shapes", 1, "centre"), "did you mean 'center'?"),
]


def problems(text):
    with pytest.raises(rt.SceneError) as caught:
        rt.Scene.parse(text, "x.yaml")
    return [caught.value, *caught.value.others]


def test_every_problem_with_its_line():
    found = {one.path: one for one in problems(BAD)}
    assert len(found) == len(FOUND)
    for line, path, said in FOUND:
        assert found[path].line == line
        assert found[path].file == "x.yaml"
        assert said in str(found[path])
        assert str(found[path]).isprintable()


def test_the_command_line_prints_a_line_for_each(tmp_path):
    (tmp_path / "x.yaml").write_text(BAD, encoding="utf-8")
    done = CliRunner().invoke(app, ["explain", str(tmp_path / "x.yaml")])
    assert done.exit_code == 3
    lines = done.stderr.splitlines()
    assert len(lines) == len(FOUND)
    assert all(line.startswith(f"error: {tmp_path / 'x.yaml'}:") for line in lines)


def test_descriptions_made_in_python_have_all_problems_too():
    with pytest.raises(rt.SceneError) as caught:
        rt.Film(width=0, height="tall", depth=3)
    paths = [one.path for one in (caught.value, *caught.value.others)]
    assert sorted(paths) == [("depth",), ("height",), ("width",)]


def test_a_mistake_in_many_places_is_told_a_few_times():
    shapes = "".join(f"  - {{type: sphere, radius: -{k + 1}}}\n" for k in range(500))
    assert len(problems(f"shapes:\n{shapes}")) == MOST


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("shapes: [{type: spheres}]", "did you mean 'sphere'?"),
        ("shapse: []", "did you mean 'shapes'?"),
        ("integrator: {type: pathh}", "did you mean 'path'?"),
        (
            "materials: {grey: {type: diffuse}}\nshapes: [{type: sphere, material: gray}]",
            "did you mean 'grey'?",
        ),
        (
            "textures: {wood: {type: checker}}\nmaterials: {m: {type: diffuse, reflectance: wod}}",
            "did you mean 'wood'?",
        ),
        (
            "groups: {tree: [{type: sphere}]}\nshapes: [{type: instance, group: trees}]",
            "did you mean 'tree'?",
        ),
    ],
)
def test_names_that_are_nearly_right(text, said):
    (only,) = problems(text)
    assert said in only.message


@pytest.mark.parametrize("text", ["shapes: [{type: velvet}]", "xyzzy: 1"])
def test_no_guess_where_nothing_is_near(text):
    assert "did you mean" not in problems(text)[0].message

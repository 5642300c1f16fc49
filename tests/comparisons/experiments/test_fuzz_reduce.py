"""Reduction: scenes become small while they fail in the same way."""

import pytest

from comparisons.experiments.fuzz import assets
from comparisons.experiments.fuzz.data import shapes_of, text_of
from comparisons.experiments.fuzz.finding import Grammar
from comparisons.experiments.fuzz.generate import generate, parse
from comparisons.experiments.fuzz.reduce import reduce, simpler, without_unused
from comparisons.experiments.fuzz.schema import types_in
from reference_rt.util.errors import SceneError

pytestmark = pytest.mark.filterwarnings("ignore::reference_rt.util.errors.SceneWarning")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return assets.write(tmp_path_factory.mktemp("files"))


def valid(data, files):
    try:
        parse(data, "x", files)
    except SceneError:
        return False
    return True


@pytest.mark.cases(2)
@pytest.mark.parametrize("wanted", ["torus", "mesh", "difference", "instance", "bump", "emissive"])
def test_what_fails_by_a_type_is_reduced_to_that_type(files, wanted):
    def fails(data):
        named = {s.get("material") for s in shapes_of(data)} | {None}
        used = {"materials": {k: v for k, v in data.get("materials", {}).items() if k in named}}
        there = {n for _, n in types_in({**data, **used})}
        return wanted in there and valid(data, files)

    scenes = (generate(2, number, Grammar((wanted,)), files) for number in range(30))
    scene = next(scene for scene in scenes if fails(scene))  # of materials some are not used
    found = reduce(scene, fails, most=3000, seconds=600.0)
    assert found.done
    assert fails(found.scene)
    assert len(found.scene["shapes"]) == 1
    assert len(text_of(found.scene).splitlines()) <= 10
    assert "lights" not in found.scene
    assert found.tried < 1000


def test_numbers_become_simple_and_stay_where_they_matter(files):
    scene = {
        "camera": {"type": "perspective", "eye": [1.234, 2.345, 5.678]},
        "shapes": [{"type": "sphere", "radius": 0.4567, "center": [0.123, 0.456, 0.789]}],
    }

    def fails(data):
        shapes = data.get("shapes", [])
        return bool(shapes) and shapes[0].get("radius", 1.0) < 0.5 and valid(data, files)

    found = reduce(scene, fails).scene
    assert found["shapes"] == [{"type": "sphere", "radius": 0.46}]
    # The camera stays near: at its default place it may be on a surface.
    assert found["camera"]["eye"] == [1, 2, 6]


@pytest.mark.slow
def test_limits_are_kept(files):
    scene = generate(2, 7, Grammar(), files)
    tried = []

    def fails(data):
        tried.append(data)
        return True

    found = reduce(scene, fails, most=5)
    assert found.tried == len(tried) == 5
    assert not found.done
    ticks = iter(range(1000))
    late = reduce(scene, fails, seconds=10.0, clock=lambda: float(next(ticks)))
    assert not late.done


def test_simpler_numbers_are_shorter():
    assert simpler(0.0) == simpler(1.0) == []
    assert simpler(-1.0) == [1.0, 0.0]
    for x in (0.4567, -12.3, 1e-7, 90.0, 2.5):
        assert all(len(f"{y:g}".lstrip("-")) < len(repr(x).lstrip("-")) for y in simpler(x))
    assert 0.0 not in simpler(2.34, digits_only=True)


def test_unused_parts_go():
    scene = {
        "materials": {
            "a": {"type": "mask", "base": "b"},
            "b": {"type": "diffuse", "reflectance": "t"},
            "c": {"type": "mirror"},
        },
        "textures": {"t": {"type": "checker"}, "u": {"type": "checker"}},
        "groups": {"g": [{"type": "box"}]},
        "shapes": [{"type": "sphere", "material": "a"}],
        "lights": [],
    }
    found = without_unused(scene)
    assert [*found["materials"]] == ["a", "b"]
    assert [*found["textures"]] == ["t"]
    assert "groups" not in found
    assert "lights" not in found

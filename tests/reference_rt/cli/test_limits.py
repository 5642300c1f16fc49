"""What exceeds float64's precision is reported at the stated bounds, and not before."""

from pathlib import Path

import pytest
from command_line import invoke

from reference_rt.cli.limits import LAW, Limit, in_words, limits_of
from reference_rt.rendering import query
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables

U = 2.0**-53
SCENES = sorted((Path(__file__).parents[3] / "scenes").glob("*.yaml"))
STIFF = ("planet", "needle", "far_origin", "tiny", "slivers", "grazing", "nested_glass")


def limits(text: str) -> list[Limit]:
    return limits_of(Scene.parse(text))


def beyond(text: str) -> list[str]:
    return [limit.law for limit in limits(text) if limit.is_beyond]


def test_the_law_is_that_of_points_on_surfaces() -> None:
    assert pytest.approx(16.0 * 3.0**0.5 * U, rel=1e-15) == LAW


@pytest.mark.parametrize("offset", [1.0e3, 1.0e9])
def test_a_shape_as_small_as_its_error_is_reported(offset: float) -> None:
    eye = f"camera: {{type: perspective, eye: [0, 0, {offset}], target: [0, 0, 0]}}\n"
    # Its far side and the eye are at the offset, to within its own size.
    bound = LAW * 2.0 * offset
    for factor, law in ((0.98, ["size"]), (1.02, [])):
        ball = f"center: [{offset}, 0, 0], radius: {factor * bound / 2.0}"
        assert beyond(f"{eye}shapes:\n  - {{type: sphere, {ball}}}\n") == law


def test_a_shape_whose_products_overflow_is_reported() -> None:
    for exponent, law in ((510, ["range"]), (506, [])):
        ball = f"shapes:\n  - {{type: sphere, radius: {2.0**exponent!r}}}\n"
        (found,) = [limit for limit in limits(ball) if limit.law == "range"]
        assert beyond(ball) == law
        assert "reaches" in in_words(found)
        # What is told is so: at the lower size rays from inside hit.
    scene = build_tables(Scene.parse(ball))
    assert query.intersect(scene, [[0.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]]).t[0] == 2.0**506


def test_a_far_eye_counts_as_a_far_shape() -> None:
    ball = "shapes:\n  - {type: sphere, radius: 1.0e-6}\n"
    near = "camera: {type: perspective, eye: [0, 0, 1.0e+8], target: [0, 0, 0]}\n"
    far = "camera: {type: perspective, eye: [0, 0, 1.0e+9], target: [0, 0, 0]}\n"
    assert beyond(near + ball) == []
    assert beyond(far + ball) == ["size"]


@pytest.mark.parametrize("inner", [True, False])
def test_a_gap_as_narrow_as_two_errors_is_reported(inner: bool) -> None:
    error = LAW * (1.0 + 1.0 + 2.0)  # eye and sphere within 1 of the origin, 2 across
    if inner:
        shapes = "  - {{type: sphere}}\n  - {{type: sphere, radius: {0!r}}}\n"
        narrow, wide = 1.0 - 1.5 * error, 1.0 - 3.0 * error
    else:
        shapes = (
            "  - {{type: rectangle}}\n  - {{type: rectangle, transform: "
            "[{{translate: [0, 0, {0!r}]}}]}}\n"
        )
        narrow, wide = 1.5 * error, 3.0 * error
    assert beyond("shapes:\n" + shapes.format(narrow)) == ["gap"]
    assert beyond("shapes:\n" + shapes.format(wide)) == []


def test_what_is_in_one_place_is_no_gap() -> None:
    assert limits("shapes:\n  - {type: sphere}\n  - {type: sphere}\n")[0].law == "size"
    together = "  - {type: box, transform: [{translate: [2, 0, 0]}]}\n"
    assert beyond("shapes:\n  - {type: box}\n" + together) == []


@pytest.mark.parametrize(("ulps", "law"), [(0, []), (1, ["index"]), (2, [])])
def test_an_index_within_rounding_of_1_is_reported(ulps: int, law: list[str]) -> None:
    material = f"  glass: {{type: dielectric, interior_ior: {1.0 + ulps * 2.0 * U!r}}}\n"
    assert beyond("materials:\n" + material) == law


def test_copies_and_operands_are_looked_at() -> None:
    text = """
groups:
  dots:
    - {type: sphere, radius: 1.0e-3}
shapes:
  - {type: instance, group: dots, transform: [{translate: [1.0e+13, 0, 0]}]}
  - {type: difference, of: [{type: box}, {type: box, transform: [{scale: 1.0e-17}]}]}
"""
    found = [limit.what for limit in limits(text) if limit.is_beyond]
    assert sorted(found) == ["shapes[0], dots[0] (sphere)", "shapes[1], operand 1 (box)"]


def test_it_is_reported_in_words() -> None:
    assert (
        in_words(Limit("gap", "a and b", 2e-16, 1e-15))
        == "a and b: 2e-16, float64's error is 1e-15"
    )
    assert "2 times" in in_words(Limit("gap", "a and b", 2e-15, 1e-15))


@pytest.mark.parametrize("name", STIFF)
def test_stiff_scenes_are_within_float64(name: str) -> None:
    path = next(path for path in SCENES if path.stem == name)
    found = limits_of(Scene.load(path))
    assert found
    assert not any(limit.is_beyond for limit in found)


SOUND = "camera: {type: perspective, eye: [0, 0, 5]}\nlights: [{type: constant, radiance: 1}]\n"


def test_explain_warns(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text("shapes:\n  - {type: sphere, center: [1.0e+17, 0, 0]}\n", encoding="utf-8")
    shown = invoke("explain", path).output
    assert "warning: beyond float64" in shown
    path.write_text(f"{SOUND}shapes:\n  - {{type: sphere}}\n", encoding="utf-8")
    shown = invoke("explain", path).output
    assert "nearest to float64's limits" in shown
    assert "warning" not in shown

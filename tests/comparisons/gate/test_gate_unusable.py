"""Pictures and options that the gate cannot use: each has its message."""

from pathlib import Path

import numpy as np
import pytest
from gate_checks import files, run, write
from junitparser import JUnitXml

from reference_rt.core.arrays import FloatArray
from reference_rt.core.exr import write_exr
from reference_rt.rendering.image import srgb, write_png

pytestmark = pytest.mark.usefixtures("gate_folder")


def bad_pictures(picture: FloatArray) -> dict[str, tuple[str, str]]:
    """Name of a file, and what is said about it."""
    whole = Path(write("whole.exr", picture)).read_bytes()
    holed = picture.copy()
    holed[3, 4, 1] = np.nan
    Path("truncated.exr").write_bytes(whole[:-50])
    return {
        "size": (write("size.exr", picture[:, 1:]), "is 31 x 32 pixels; expected 32 x 32"),
        "nan": (write("nan.exr", holed), "not finite"),
        "truncated": ("truncated.exr", "it is truncated or damaged; expected a whole image"),
        "black": (write("black.exr", 0.0 * picture), "black"),
        "transparent": (transparent(picture), "transparent"),
    }


def transparent(picture: FloatArray) -> str:
    planes = {name: picture[..., k] for k, name in enumerate("RGB")}
    write_exr(Path("transparent.exr"), planes | {"A": 0.0 * picture[..., 0]}, {})
    return "transparent.exr"


BAD = ("size", "nan", "truncated", "black", "transparent")
"""What readers refuse besides: `test_gate_pictures_refused`."""


@pytest.mark.cases(5)
@pytest.mark.parametrize("name", BAD)
@pytest.mark.parametrize("replicated", [False, True])
def test_bad_pictures_have_their_message(right: FloatArray, name: str, replicated: bool) -> None:
    file, message = bad_pictures(right[3])[name]
    given = [*files(right[:3]), file] if replicated else [file]
    result, found = run(*given, "--scene", "ball.yaml", "--junit", "junit.xml")
    assert result.exit_code == 3, result.output
    assert message in result.output
    case = found["cases"][0]
    assert case["verdict"] == "invalid"
    assert message in case["reason"]
    assert JUnitXml.fromfile("junit.xml").errors == 1
    assert Path("out/report.html").exists()


def test_a_bad_reference(right: FloatArray) -> None:
    for name, (file, message) in bad_pictures(right[3]).items():
        result, _ = run(*files(right[:2]), "--reference", file)
        if name == "size":
            assert "c0.exr: is 32 x 32 pixels; expected 31 x 32, as the reference" in result.output
        elif name == "truncated":
            assert message in result.output
        if name != "transparent":  # which says nothing against a reference's radiance
            assert result.exit_code == 3, (name, result.output)


def test_eight_bits_of_a_noisy_picture_are_no_radiance(right: FloatArray) -> None:
    names = [f"c{k}.png" for k in range(4)]
    for name, picture in zip(names, right, strict=True):
        write_png(Path(name), srgb(picture), {})
    result, _ = run(*names, "--scene", "ball.yaml")
    assert result.exit_code == 3, result.output
    assert "8-bit sRGB codes" in result.output


def test_replicates_must_be_independent(right: FloatArray) -> None:
    result, _ = run(*files(right[[0, 0, 1]]), "--scene", "ball.yaml")
    assert result.exit_code == 3, result.output
    assert "ball: invalid: nothing can be said: replicates 0, 1 of 3" in result.output


def test_wrong_usage(right: FloatArray) -> None:
    candidate = write("c.exr", right[0])
    for arguments, message in (
        ([candidate], "expected a scene, reference or baseline"),
        (["--scene", "ball.yaml"], "expected either candidates, --command, --browser or --pair"),
        (
            [candidate, "--command", "x {output}"],
            "expected either candidates, --command, --browser or --pair",
        ),
        ([candidate, "--scene", "ball.yaml", "--seed", "3"], "--seed: only applies to --command"),
        ([candidate, "--scene", "ball.yaml", "--fixed"], "--fixed: only applies to --command"),
        ([candidate, "--reference", candidate, "--size", "8x8"], "--size: only applies to --s"),
        ([candidate, "--reference", candidate, "--spp", "8"], "--spp: only applies to --scene"),
        ([candidate, "--scene", "ball.yaml", "--size", "8"], "--size: expected WIDTHxHEIGHT"),
        (["--command", "x {output} {seed} {seeds}"], "has {seed} and {seeds}; expected one"),
        (["--command", "x {output} {width}"], "has {width}; expected --size or --scene too"),
        ([candidate, "--scene", "ball.yaml", "--variance", "v.exr"], "variance without a referen"),
        ([candidate, "--reference", candidate, "--baseline", "b"], "a reference and a baseline"),
        ([candidate, "--baseline", "../b"], "'../b' is not a valid name of a baseline"),
        (["--command", "x {outptu}", "--scene", "ball.yaml"], "there is no {outptu}"),
        (["--command", "x {scene}", "--scene", "ball.yaml"], "has no {output}"),
    ):
        result, found = run(*arguments)
        assert (result.exit_code, message in result.output) == (2, True), result.output
        assert found is None
    result, _ = run(candidate, "--scene", "none.yaml")
    assert (result.exit_code, "none.yaml: cannot be read" in result.output) == (3, True)

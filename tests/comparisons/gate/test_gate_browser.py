"""Pages as renderers: what they get, what they return, and each way to fail has its message."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gate_checks import run

from comparisons.gate.driver import Command, Driver, RendererError

pytestmark = pytest.mark.usefixtures("chromium")

GRADIENT = "Float32Array.from({length: 72}, (_, k) => k / 3)"

LOSES = """const gl = document.createElement("canvas").getContext("webgl2");
gl.getExtension("WEBGL_lose_context").loseContext();"""


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the page is to be written; its folder is the working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path / "page.html"


def driver(page: str, seconds: float = 60.0, **values: Any) -> Driver:
    more = {"scene": None, "spp": None, "size": (6, 3), "suffix": ".npy", "seconds": seconds}
    return Driver(Command.of_page(page, **(more | values)), Path("kept"))


def rendering(body: str) -> str:
    """A page whose `window.render` does this, with {width, height, seed, scene} at hand."""
    return f"<script>window.render = async ({{width, height, seed, scene}}) => {{{body}}}</script>"


def test_a_page_gets_its_query_scene_and_seed_and_returns_every_bit(page: Path) -> None:
    """The floats are those of the bits 1, 2, ...: denormal numbers, and no decimal number."""
    page.write_text(
        rendering("""
        const { first } = await (await fetch(scene)).json(), pixels = new Float32Array(72);
        const step = Number(new URLSearchParams(location.search).get("step"));
        if (!crossOriginIsolated || !navigator.gpu) throw new Error("no threads, or no WebGPU");
        new Uint32Array(pixels.buffer).forEach((_, k, of) => { of[k] = first + step * k + seed; });
        return { width, height, pixels, bottomUp: seed > 1000 };""")
    )
    Path("data").mkdir()
    Path("data/scene.json").write_text('{"first": 5}')
    found = driver(f"{page}?step=7", scene=Path("data/scene.json")).pictures([2, 1001])
    assert len(found) == 2
    for picture, seed, rows in zip(
        found, (2, 1001), (slice(None), slice(None, None, -1)), strict=True
    ):
        bits = np.arange(72, dtype=np.uint32) * 7 + 5 + seed
        expected = bits.view(np.float32).reshape(3, 6, 4)[rows]
        np.testing.assert_array_equal(picture.radiance, expected[..., :3])


def test_codes_of_a_canvas(page: Path) -> None:
    """With .png the page returns 8-bit sRGB codes."""
    page.write_text(
        rendering("""
        const canvas = new OffscreenCanvas(width, height).getContext("2d");
        canvas.fillStyle = "rgb(188 0 255)";
        canvas.fillRect(0, 0, width, 1);
        return { width, height, pixels: canvas.getImageData(0, 0, width, height).data };""")
    )
    (found,) = driver(str(page), suffix=".png").pictures([1])
    assert found.displayed
    np.testing.assert_allclose(found.radiance[0, 0], [0.5028865, 0.0, 1.0], atol=1e-6)
    assert not found.radiance[1:].any()


@pytest.mark.cases(2)
@pytest.mark.parametrize(
    ("text", "message"),
    [
        pytest.param(
            "<script>render = 1 / 0</script>",
            "time limit of 15 s .* waits for window.render to be",
            marks=pytest.mark.slow,  # it waits, in another process
        ),
        pytest.param(
            rendering("await new Promise(() => {})"),
            "limit of 15 s .* waits for window.render to re",
            marks=pytest.mark.slow,
        ),
        (rendering("for (;;);"), "time limit of 3 s"),
        (rendering("const x = null; return x.y"), "TypeError: Cannot read properties of null"),
        (rendering("setTimeout(() => nothing); await new Promise(() => {})"), "nothing is not def"),
        (
            rendering("Promise.reject(Error('later')); await new Promise(() => {})"),
            "uncaught error: Error: later",
        ),
        ("<script>nothing()</script>", "uncaught error: .*nothing is not defined"),
        ('<script type="module">import "./no.js"</script>', "no.js: there is no file .*not loaded"),
        ('<script src="https://a.example/b.js"></script>', "gives no network .* was not loaded"),
        (rendering(f"{LOSES} return {{width, height, pixels: {GRADIENT}}}"), "context was lost"),
        (rendering(f"{LOSES} await new Promise(() => {{}})"), "the WebGL context was lost"),
        (rendering(""), "pixels of Undefined; expected Float32Array"),
        (rendering("return {width, height, pixels: [1]}"), "pixels of Array; expected Float32Arr"),
        (rendering(f"return {{width, pixels: {GRADIENT}}}"), "width 6 and height None; expected b"),
        (
            rendering(f"return {{width: 5, height, pixels: {GRADIENT}}}"),
            "returned 72 numbers for 5 x 3 pixels; expected 3 or 4 each",
        ),
    ],
)
def test_failures(page: Path, text: str, message: str) -> None:
    page.write_text(text)
    with pytest.raises(RendererError, match=message) as caught:
        driver(str(page), 3.0 if "limit of 3 s" in message else 15.0).pictures([1])
    assert "page.html" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert [path.name for path in Path("kept").iterdir()] == ["renderer.log"]


SCENE = """\
film: {width: 24, height: 16}
camera: {type: perspective, eye: [0.3, 0.2, 3], target: [0, 0, 0], fov: 50}
integrator: {type: whitted}
materials: {clay: {type: diffuse, reflectance: [0.7, 0.5, 0.3]}}
shapes: [{type: rectangle, material: clay}]
lights: [{type: point, position: [1, 2, 2], intensity: 9}]
"""

DOCUMENTED = (Path(__file__).parents[3] / "docs" / "realtime.md").read_text(encoding="utf-8")
PAGE = DOCUMENTED.partition("```html\n")[2].partition("```")[0]
"""It casts a ray to the square in each pixel."""


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("size", "exit_code", "verdict"),
    [
        ("width, height", 0, "agree"),
        ("width: height, height: width", 3, "invalid"),
        ("width, height, nan: pixels[9] = 0 / 0", 3, "invalid"),
    ],
)
def test_the_gate_judges_what_a_page_makes_of_a_scene(
    page: Path, size: str, exit_code: int, verdict: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither the page nor the outputs are named from the working folder down."""
    page.write_text(PAGE.replace("{ width, height, pixels", f"{{ {size}, pixels"))
    Path("square.yaml").write_text(SCENE)
    Path("here").mkdir()
    monkeypatch.chdir("here")
    result, found = run(
        *("--browser", "../page.html", "--scene", "../square.yaml", "--out", "../here/out")
    )
    assert result.exit_code == exit_code, result.output
    assert found["cases"][0]["verdict"] == verdict

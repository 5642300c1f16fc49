"""three.js through the gate, in the example's page: right pictures agree, planted faults are named.

Skipped where the example's packages are not installed: `npm ci` in examples/three."""

import shutil
from pathlib import Path

import pytest
from gate_checks import run

THREE = Path(__file__).parents[3] / "examples" / "three"

pytestmark = [
    pytest.mark.usefixtures("chromium", "gate_folder"),
    pytest.mark.skipif(
        not (THREE / "node_modules" / "three").is_dir(), reason="three is not installed: npm ci"
    ),
]

SCENES = [
    pytest.param(path.stem, marks=[] if path.stem == "orthographic" else pytest.mark.slow)
    for path in sorted((THREE / "scenes").glob("*.yaml"))
]


def judged(
    scene: str,
    page: str = str(THREE / "page.html"),
    folder: str = "scenes",
    query: str = "",
    more: tuple[str, ...] = (),
) -> dict:
    """query: what the page's address has besides;  more: options of the gate."""
    result, found = run(
        *("--browser", f"{page}?standard=textbook{query}"),
        *("--scene", str(THREE / folder / f"{scene}.yaml"), *more),
    )
    (case,) = found["cases"]
    assert result.exit_code == {"agree": 0, "invalid": 3}.get(case["verdict"], 1), result.output
    return case


@pytest.mark.parametrize("scene", SCENES)
def test_right_pictures_agree(scene: str) -> None:
    case = judged(scene)
    assert case["verdict"] == "agree", case["reason"]


@pytest.mark.slow
def test_shadows_that_are_switched_off_are_named() -> None:
    assert judged("shadow", folder="others")["cause"]["name"] == "without shadows"


FAULTS = {
    "light times pi": (
        "ball",
        ("PointLight(linear(of.intensity), 1", "PointLight(linear(of.intensity), Math.PI"),
        "constant gain of 3.14",
    ),
    "light over pi": (
        "sun",
        ("linear(of.irradiance), 1", "linear(of.irradiance), 1 / Math.PI"),
        "constant gain of 0.31",
    ),
    "light from behind": (
        "sun",
        ("of.direction).normalize()", "of.direction).normalize().negate()"),
        "directions of light are reversed",
    ),
    "gamma": (
        "ball",
        ("height, pixels,", "height, pixels: pixels.map((x) => x ** (1 / 2.2)),"),
        "gamma of 0.45",
    ),
    "upside down": ("ball", ("bottomUp: true", "bottomUp: false"), "upside down"),
    "angle of view of the other axis": (
        "ball",
        (
            "view: [l, r, b, t] }, box) {",
            "view }, box) { const [l, r, b, t] = view.map((x) => (x * 4) / 3);",
        ),
        "the angle of view is taken for that of the other axis",
    ),
    "half a pixel": (
        "ball",
        ("l * near, r * near,", "(l + (r - l) / 256) * near, (r + (r - l) / 256) * near,"),
        "pixels are half a pixel off",
    ),
    "colours taken for sRGB": (
        "ball",
        ("material.color = linear(colour)", 'material.color.setRGB(...colour, "srgb")'),
        "colours of materials are decoded from sRGB",
    ),
    "a texture taken for linear": (
        "texture",
        ("THREE.SRGBColorSpace", "THREE.NoColorSpace"),
        "sRGB textures are taken for linear",
    ),
    "a texture upside down": (
        "texture",
        ("texture.generateMipmaps =", "texture.flipY = texture.generateMipmaps ="),
        "textures are upside down",
    ),
    "green flipped": (
        "normal_map",
        ("material.normalMap =", "material.normalScale.y = -1, material.normalMap ="),
        "green of normal maps is flipped",
    ),
    "normals taken for sRGB": (
        "normal_map",
        ("THREE.NoColorSpace", "THREE.SRGBColorSpace"),
        "linear textures are taken for sRGB",
    ),
    "roughness squared": (
        "metal",
        ("roughness: of.roughness", "roughness: of.roughness ** 2"),
        "roughness is squared once too often",
    ),
    "another F0": (
        "metal",
        (
            "function cameraOf",
            'patch("lights_physical_fragment", "vec3( 0.04 )", "vec3( 0.16 )");function cameraOf',
        ),
        "reflectance head-on (F0) is 4 times as large",
    ),
    "no metals": (
        "metal",
        ("metalness: of.metallic", "metalness: 0"),
        "metals are taken for dielectrics",
    ),
}


def plant(change: tuple[str, str], folder: Path) -> None:
    text = (THREE / "page.html").read_text(encoding="utf-8")
    assert text.count(change[0]) == 1
    (folder / "page.html").write_text(text.replace(*change))
    # A link would lead out of the page's folder, which is refused.
    shutil.copytree(THREE / "node_modules", folder / "node_modules", symlinks=True)


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_planted_faults_are_named(fault: str, tmp_path: Path) -> None:
    scene, change, name = FAULTS[fault]
    plant(change, tmp_path)
    case = judged(scene, "page.html")
    assert case["verdict"] == "differ"
    assert name in case["cause"]["name"]


CURVES = {
    "ACESFilmic": "aces",
    "AgX": "agx",
    "Neutral": "neutral",
    "Reinhard": "reinhard",
    "Cineon": "cineon",
    "Linear": "linear",
}
"""Names in three.js, and ours."""


def toned(tone: str, exposure: float, scene: str, *curve: str, page: str | None = None) -> dict:
    """The case of a canvas of 8 bits, with the curve that is declared."""
    more = ("--suffix", ".png", *(x for one in curve for x in ("--tone-curve", one)))
    query = f"&tone={tone}&exposure={exposure}"
    return judged(scene, page or str(THREE / "page.html"), query=query, more=more)


def test_a_declared_tone_curve() -> None:
    case = toned("AgX", 0.6, "orthographic", "agx:0.6")
    assert case["verdict"] == "agree", case["reason"]


@pytest.mark.slow
@pytest.mark.parametrize("tone", CURVES)
def test_the_tone_curves_of_three(tone: str) -> None:
    """Declared they agree, undeclared and wrongly declared they are named."""
    name = CURVES[tone]
    for exposure in (1.0, 0.6):
        curve = f"{name}:{exposure:g}"
        for scene in ("ball", "metal"):
            case = toned(tone, exposure, scene, curve)
            assert case["verdict"] == "agree", (scene, exposure, case["reason"])
        case = toned(tone, exposure, "ball")
        if name == "linear":
            assert case["verdict"] == ("agree" if exposure == 1.0 else "differ")
            assert exposure == 1.0 or "constant gain of 0." in case["cause"]["name"]
        else:
            assert case["verdict"] == "differ"
            assert case["cause"]["name"] == f"the tone curve {curve.removesuffix(':1')}"
    for other in CURVES.values():
        if other != name:
            case = toned(tone, 1.0, "ball", other)
            assert case["verdict"] == "differ"
            assert case["cause"]["name"] == f"the tone curve {name}"


@pytest.mark.slow
@pytest.mark.parametrize("tone", CURVES)
def test_samples_that_are_averaged_as_codes(tone: str) -> None:
    """As a canvas of three.js averages them; the box is flat, so that nothing is extrapolated."""
    case = judged(
        "orthographic",
        query=f"&tone={tone}&samples=4",
        more=("--suffix", ".png", "--tone-curve", CURVES[tone]),
    )
    assert case["verdict"] == "agree", case["reason"]


BEHIND = {
    "light": ("ball", ("linear(of.intensity), 1, 0, 2", "linear(of.intensity), 1.05, 0, 2")),
    "half a pixel": ("ball", FAULTS["half a pixel"][1]),
    "roughness squared": ("metal", FAULTS["roughness squared"][1]),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("tone", CURVES)
@pytest.mark.parametrize("fault", BEHIND)
def test_faults_behind_a_tone_curve_are_seen(fault: str, tone: str, tmp_path: Path) -> None:
    scene, change = BEHIND[fault]
    plant(change, tmp_path)
    case = toned(tone, 0.6, scene, f"{CURVES[tone]}:0.6", page="page.html")
    assert case["verdict"] == "differ"
    if fault == "light":
        assert case["cause"]["name"] == "constant gain of 1.05 before the tone curve"
    if fault == "roughness squared":
        assert case["cause"]["name"] == "roughness is squared once too often"

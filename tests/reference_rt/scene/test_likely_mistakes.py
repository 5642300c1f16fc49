"""Scenes that are valid, but probably not what was meant: a warning names the likely mistake."""

import pytest
from builders import SCENES
from command_line import invoke

import reference_rt as rt
from reference_rt.scene.likely_mistakes import likely_mistakes

CAMERA = "camera: {type: perspective, eye: [0, 0, 5]}\n"
BALL = "shapes: [{type: sphere}]\n"
SKY = "lights: [{type: constant, radiance: 1}]\n"
CAST = "integrator: {type: ray_cast}\n"
WHITTED = "integrator: {type: whitted}\n"
LAMP = "materials: {lamp: {type: emissive, radiance: 1}}\n"


def spot(cutoff):
    return (
        "lights: [{type: spot, origin: [0, 3, 0], target: [0, 0, 0], intensity: 1, "
        f"cutoff_angle: {cutoff}}}]\n"
    )


def turned(*degrees):
    steps = ", ".join(f"{{rotate: {{axis: [1, 0, 0], degrees: {x}}}}}" for x in degrees)
    return f"shapes: [{{type: box, transform: [{steps}]}}]\n"


def fov(degrees, camera="perspective"):
    return f"camera: {{type: {camera}, eye: [0, 0, 5], fov: {degrees}}}\n"


MISTAKES = {
    "no camera": (BALL + SKY, "", "no camera"),
    "fov": (fov(0.87) + BALL + SKY, "camera.fov", "expected 49.85"),
    "fov of a lens": ("camera: {type: thin_lens, aperture_radius: 0.1, fov: 1.2}\n" + BALL + SKY,
     "camera.fov", "expected 68.75"),
    "spot": (CAMERA + BALL + spot(0.35), "lights[0].cutoff_angle", "expected 20.05"),
    "turn": (CAMERA + turned(1.5708) + SKY, "shapes[0].transform[0].rotate.degrees", "90"),
    "turns in a group": (CAMERA + BALL + SKY + "groups: {g: [{type: union, of: [{type: sphere, "
     "transform: [{rotate: {axis: [0, 1, 0], degrees: 0.5236}}]}]}]}\n",
     "groups.g[0].of[0].transform[0].rotate.degrees", "expected degrees, here 30"),
    "no lights": (CAMERA + BALL, "", "no lights and no emissive materials"),
    "no lights, whitted": (CAMERA + BALL + WHITTED, "", "integrator 'ray_cast'"),
    "a lamp that no shape has": (CAMERA + BALL + LAMP, "", "emissive material 'lamp'"),
    "a dark light": (CAMERA + BALL + "lights: [{type: point, position: [0, 9, 0], intensity: 0}]\n",
     "lights", "intensity 0"),
    "a dark lamp": (CAMERA + "materials: {lamp: {type: emissive, radiance: 0}}\n"
     "shapes: [{type: sphere, material: lamp}]\n", "", "radiance"),
    "ambient light without whitted": (CAMERA + BALL + "lights: [{type: ambient, radiance: 1}]\n",
     "lights", "ambient light"),
    "no shapes": (CAMERA + CAST, "", "no shapes"),
}  # fmt: skip

SMOKE = (
    CAMERA + SKY + "materials: {n: {type: none}}\n"
    "shapes: [{type: sphere, material: n, interior: m, center: [0, 0, 0]}]\n"
    "media: {m: {type: homogeneous, sigma_t: 1e300, albedo: 1}}\n"
)
"""Whose light is scattered within 1e-300 of the boundary."""

MISTAKES |= {
    "too dense": (SMOKE, "media.m", "sigma_t"),
    "too dense for its scale": (SMOKE.replace("1e300", "8, scale: 1e12"), "media.m", "sigma_t"),
    "too dense for where it is": (
        SMOKE.replace("1e300", "1e9").replace("center: [0, 0, 0]", "center: [0, 0, 1000]"),
        "media.m",
        "sigma_t",
    ),
    "too dense outside": (SMOKE.replace("interior", "exterior"), "media.m", "sigma_t"),
    "too dense in one colour": (SMOKE.replace("1e300", "[0, 1e300, 1]"), "media.m", "sigma_t"),
}

MEANT = {
    "dense": SMOKE.replace("1e300", "1e9"),
    "soot": SMOKE.replace("albedo: 1", "albedo: 0"),
    "soot of one colour": SMOKE.replace("1e300, albedo: 1", "[1e300, 1, 1], albedo: [0, 1, 1]"),
    "an endless boundary": SMOKE.replace("type: sphere", "type: plane").replace(
        ", center: [0, 0, 0]", ""
    ),
    "first surfaces of what is dense": SMOKE + CAST,
    "ray casting needs no light": CAMERA + BALL + CAST,
    "a sky and nothing else": CAMERA + SKY,
    "tele lens": fov(2) + BALL + SKY,
    "microscope": fov(1e-6) + BALL + SKY,
    "wide": fov(90.5) + BALL + SKY,
    "a narrow spot": CAMERA + BALL + spot(1),
    "degrees": CAMERA + turned(90, 30, 1.57) + SKY,
    "one degree": CAMERA + turned(1, 2, 3) + SKY,
    "an enormous turn": CAMERA + turned("1.7e+308") + SKY,
    "a tiny turn": CAMERA + turned("5.0e-324") + SKY,
    "no turn": CAMERA + turned(0) + SKY,
    "ambient light": CAMERA + BALL + WHITTED + "lights: [{type: ambient, radiance: 1}]\n",
    "a lamp": CAMERA + LAMP + "shapes: [{type: sphere, material: lamp}]\n",
    "a lamp that scattered rays find": CAMERA + LAMP + "shapes: [{type: torus, material: lamp}]\n",
}


def found(text):
    scene = rt.Scene.parse(text)
    return likely_mistakes(scene, rt.build_tables(scene)), scene


def test_named():
    for name, (text, keys, words) in MISTAKES.items():
        (mistake,), scene = found(text)
        assert words in mistake.message, name
        error = scene.error(mistake.message, *mistake.path)
        assert str(error).startswith(f"<scene>:{error.line}: {keys}".rstrip()), name


def test_not_named():
    for name, text in MEANT.items():
        assert found(text)[0] == [], name


def test_scenes_of_the_project_have_none():
    for file in SCENES.glob("*.yaml"):
        scene = rt.Scene.load(file)
        assert likely_mistakes(scene, rt.build_tables(scene)) == [], file


def test_a_scene_of_python_has_the_default_camera():
    scene = rt.Scene(shapes=(rt.Sphere(),), lights=(rt.Constant(radiance=(1, 1, 1)),))
    assert likely_mistakes(scene, rt.build_tables(scene)) == []


@pytest.mark.parametrize("z", [0, 1000])
def test_light_is_lost_in_media_that_are_too_dense(z):
    """Of dense media the light does not depend on the density: up to the one that is told nothing
    is lost, and far beyond it much."""
    text = SMOKE.replace("albedo: 1", "albedo: 0.9").replace(
        "center: [0, 0, 0]", f"center: [0, 0, {z}]"
    )
    text = text.replace("eye: [0, 0, 5]", f"eye: [0, 0, {z + 5}], target: [0, 0, {z}]")
    text += "film: {width: 4, height: 4}\nsampler: {type: independent, spp: 1024}\n"
    (mistake,), _ = found(text)
    most = float(mistake.message.split("at most ")[1].split(",")[0])

    def light(density):
        return rt.render(rt.Scene.parse(text.replace("1e300", f"{density:.17g}"))).colour.mean()

    right = light(1e5)
    assert light(most) == pytest.approx(right, rel=2e-3)
    with pytest.warns(rt.SceneWarning, match="light that it scatters is lost"):
        assert light(1e4 * most) < 0.95 * right


def test_a_changed_scene_is_still_without_camera():
    scene = rt.Scene.parse(BALL + SKY).changed(film=rt.Film(width=2, height=2))
    assert len(likely_mistakes(scene, rt.build_tables(scene))) == 1


def test_render_warns(tmp_path):
    """In Python, on the command line, and by `explain`."""
    file = tmp_path / "scene.yaml"
    file.write_text(CAST + "film: {width: 2, height: 2}\n" + BALL)
    with pytest.warns(rt.SceneWarning, match="no camera"):
        rt.render(rt.Scene.load(file))
    result = invoke("render", file, "-o", tmp_path / "out.png")
    assert result.exit_code == 0
    assert result.stderr.startswith(f"warning: {file}:1: the scene has no camera")
    told = invoke("explain", file)
    assert "probably a mistake" in told.stdout


def test_a_black_picture_is_reported(tmp_path):
    """The camera looks away: on the command line alone, which people look at."""
    file = tmp_path / "scene.yaml"
    away = "camera: {type: perspective, eye: [0, 0, 5], target: [0, 0, 9]}\n"
    file.write_text(CAST + away + "film: {width: 2, height: 2}\n" + BALL)
    result = invoke("render", file, "-o", tmp_path / "out.png")
    assert result.exit_code == 0
    assert "the picture is black: no light reaches" in result.stderr

"""What POV-Ray is given, and the reasons why it does not vote; without POV-Ray."""

import os
import stat

import pytest
from builders import SCENES
from command_line import invoke

import reference_rt as rt
from comparisons.povray import run
from comparisons.povray.translate import hits, obstacles, picture
from comparisons.renderers import NoCounterpartError
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ReferenceUnavailableError

BALL = rt.Sphere(material="m")


def of(*shapes, material=None, **fields):
    fields = {"integrator": rt.Whitted(), "materials": {"m": material or rt.Diffuse()}} | fields
    return rt.Scene(
        camera=rt.Perspective(eye=(0, 0, 5), target=(0, 0, 0)), shapes=shapes or (BALL,), **fields
    )


GLASS = rt.Dielectric(interior_ior=1.5)

REASONS = {
    "the integrator path": of(integrator=rt.Path()),
    "the integrator direct": of(integrator=rt.Direct()),
    "more than 256 levels of rays": of(integrator=rt.Whitted(max_depth=256)),
    "the light spot": of(lights=(rt.Spot(origin=(0, 3, 0), target=(0, 0, 0), intensity=1),)),
    "the material emissive": of(material=rt.Emissive(radiance=1)),
    "the material plastic": of(material=rt.Plastic()),
    "a highlight of Phong's that is coloured": of(
        material=rt.Phong(diffuse=0.1, specular=(0.1, 0.2, 0.1))
    ),
    "ambient light in a channel without diffuse light": of(
        material=rt.Phong(diffuse=(0.1, 0, 0), ambient=0.1)
    ),
    "the material dielectric with another exterior_ior than 1.0": of(
        material=rt.Dielectric(exterior_ior=1.3)
    ),
    "glass whose index is not above 1": of(material=rt.Dielectric(interior_ior=0.7)),
    "dielectric on an open shape": of(rt.Disk(material="m"), material=GLASS),
    "something that may be in glass, or touch it": of(
        BALL, rt.Box(material="m", transform=[{"scale": 0.1}]), material=GLASS
    ),
    "a polygon that is not convex: POV-Ray's front may be another one": of(
        rt.Polygon(rings=(((0, 0), (1, 0), (0.2, 0.2), (0, 1)),))
    ),
    "a polygon of several rings: POV-Ray's front may be another one": of(
        rt.Polygon(rings=(((0, 0), (1, 0), (1, 1)), ((0.6, 0.2), (0.8, 0.2), (0.8, 0.6))))
    ),
    "a view of less than a thousandth of the scene": of(rt.Sphere(radius=1e5)),
    "the shape sphere under a texture": of(
        material=rt.Diffuse(reflectance="t"),
        textures={"t": rt.Checker(first=(0, 0, 0), second=(1, 1, 1))},
    ),
    "the filter gaussian": of(film=rt.Film(filter=rt.GaussianFilter())),
}


@pytest.mark.parametrize("reason", REASONS)
def test_reasons(reason):
    with pytest.raises(NoCounterpartError) as found:
        picture(REASONS[reason])
    assert reason in str(found.value).split("; ")


def test_a_pentagram_is_not_convex():
    star = ((0.0, 1.0), (0.6, -0.8), (-1.0, 0.3), (1.0, 0.3), (-0.6, -0.8))
    with pytest.raises(NoCounterpartError, match="not convex"):
        picture(of(rt.Polygon(rings=(star,))))


def test_glass_may_stand_on_a_plane_as_a_ball_does():
    floor = rt.Rectangle(material="floor", transform=[{"scale": 9}, {"translate": (0, 0, -1)}])
    materials = {"m": GLASS, "floor": rt.Diffuse()}
    assert picture(of(BALL, floor, materials=materials))
    with pytest.raises(NoCounterpartError, match="in glass, or touch it"):
        picture(of(rt.Box(material="m"), floor, materials=materials))


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(path.stem for path in SCENES.glob("*.yaml")))
def test_every_scene_is_translated_or_refused_by_name(name):
    scene = Scene.load(SCENES / f"{name}.yaml")
    for reason in obstacles(scene):
        assert reason.startswith(("picture: ", "first hits: "))


def test_first_hits_leave_out_shapes_by_name():
    star = rt.Polygon(rings=(((0, 0), (1, 0), (0.2, 0.2), (0, 1)),))
    given = hits(of(star, BALL, star))
    assert given.shapes == (1,)
    assert list(given.left_out.values()) == [2]
    assert all("polygon" in reason for reason in given.left_out)


def test_small_and_far_scenes_are_moved():
    """POV-Ray's epsilons are absolute: it is given scenes of one size."""
    for size, place in ((1e-6, 0.0), (1e6, 0.0), (1.0, 1e7)):
        ball = rt.Sphere(center=(place, 0, 0), radius=size)
        camera = rt.Perspective(eye=(place, 0, 4 * size), target=(place, 0, 0))
        frame = hits(of(ball).changed(camera=camera)).frame
        assert 512.0 <= 5.0 * size * frame.scale / 2.0 < 1024.0
        assert abs(frame.center[0] - place) <= size


# ---- without POV-Ray -----------------------------------------------------------------------------


def test_without_povray(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ReferenceUnavailableError, match="to get it: apt install povray"):
        run.version()
    result = invoke("compare", SCENES / "csg_dice.yaml", "--witness", "povray")
    assert result.exit_code == 4
    assert "POV-Ray is not installed; to get it: apt install povray" in result.output


def test_another_version(monkeypatch, tmp_path):
    fake = tmp_path / "povray"
    fake.write_text("#!/bin/sh\necho 'POV-Ray 3.8.0-beta.1' >&2\n")
    fake.chmod(fake.stat().st_mode | stat.S_IEXEC)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    with pytest.raises(ReferenceUnavailableError, match=r"is 3\.8\.0; expected POV-Ray 3\.7"):
        run.version()


def test_a_run_that_fails(monkeypatch, tmp_path):
    fake = tmp_path / "povray"
    fake.write_text("#!/bin/sh\necho 'Parse Error: no such thing' >&2\nexit 1\n")
    fake.chmod(fake.stat().st_mode | stat.S_IEXEC)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    with pytest.raises(ReferenceUnavailableError, match="POV-Ray: Parse Error: no such thing"):
        run.rendered("", 2, 2)

"""Scenes that contradict themselves about media."""

import pytest

import reference_rt as rt
from reference_rt.cli.media_sides import contradictions

MEDIA = {name: rt.Homogeneous(sigma_t=1.0, albedo=0.5) for name in ("fog", "ink")}
FOG = rt.Sphere(interior="fog")
CASES = {
    "one": (0, (FOG,)),
    "next to each other": (0, (FOG, rt.Sphere(center=(2.1, 0, 0), interior="ink"))),
    "one in another": (0, (FOG, rt.Sphere(radius=0.5, interior="ink", exterior="fog"))),
    "a surface in one": (0, (FOG, rt.Sphere(radius=0.5))),
    "overlapping": (2, (FOG, rt.Sphere(center=(0.9, 0, 0), interior="ink"))),
    "an exterior left out": (1, (FOG, rt.Sphere(radius=0.5, interior="ink"))),
    "the same in itself": (1, (FOG, rt.Sphere(radius=0.5, interior="fog"))),
    "a camera that is elsewhere": (1, (FOG.model_copy(update={"exterior": "ink"}),)),
    "turned inside out": (1, (FOG.model_copy(update={"interior": None, "exterior": "fog"}),)),
}


@pytest.mark.parametrize("case", CASES)
def test_what_contradicts_itself_is_named(case):
    shapes_named, shapes = CASES[case]
    scene = rt.Scene(
        camera=rt.Perspective(eye=(0, 0.3, 6), target=(0, 0, 0), fov=40),
        media=MEDIA,
        shapes=shapes,
        lights=(rt.Constant(radiance=1.0),),
    )
    found = contradictions(scene)
    assert len({mistake.path for mistake in found}) == shapes_named, found
    assert all("do not overlap" in mistake.message for mistake in found)


def test_a_scene_without_media_is_not_looked_at():
    assert contradictions(rt.Scene(shapes=(rt.Sphere(),))) == []

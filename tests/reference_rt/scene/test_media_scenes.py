"""Scenes with media: what is refused, with words, and which medium is on which side."""

import numpy as np
import pytest

import reference_rt as rt
from reference_rt.core.model import name_of, types_of
from reference_rt.integrators import AnyIntegrator
from reference_rt.media.tables import UNCHANGED, VACUUM
from reference_rt.scene.build_media import Boundary, boundaries, media_of

BASE = """
materials:
  edge: {type: none}
  clay: {type: diffuse}
media:
  fog: {type: homogeneous, sigma_t: 0.5, albedo: 0.9}
lights:
  - {type: constant, radiance: 1}
"""

WRONG = {
    "no such medium": "shapes: [{type: sphere, interior: smog}]",
    "no such medium of the camera": "camera: {type: perspective, medium: smog}",
    "an operand": "shapes: [{type: union, of: [{type: sphere, interior: fog}, {type: box}]}]",
    "an instance": (
        "groups: {g: [{type: box}]}\nshapes: [{type: instance, group: g, exterior: fog}]"
    ),
    "a mask of nothing": "materials: {edge: {type: none}, m: {type: mask, base: edge}}",
    "a lamp of nothing": "materials: {e: {type: none}, m: {type: emissive, radiance: 1, base: e}}",
    "no length": "media: {fog: {type: homogeneous, sigma_t: -1, albedo: 0.5}}",
    "beyond floats": "media: {a: {type: homogeneous, sigma_t: 1.0e+300, albedo: 1, scale: 1.0e+9}}",
    "more than all": "media: {fog: {type: homogeneous, sigma_t: 1, albedo: [0.5, 1.5, 0.5]}}",
    "a mirror of a phase": (
        "media: {a: {type: homogeneous, sigma_t: 1, albedo: 1, phase: {type: hg, g: 1}}}"
    ),
    "no such phase": "media: {fog: {type: homogeneous, sigma_t: 1, albedo: 1, phase: {type: mie}}}",
    "no such type": "media: {fog: {type: heterogeneous, sigma_t: 1, albedo: 1}}",
    "overlapping by priority": "shapes: [{type: sphere, interior: fog, priority: 2}]",
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_refused(name, wording):
    text, own = BASE, WRONG[name]
    key = own.partition(":")[0]
    if f"\n{key}:" in text:  # a file has each key once
        kept = [part for part in text.split("\n") if part]
        start = kept.index(f"{key}:")
        end = next((k for k in range(start + 1, len(kept)) if not kept[k].startswith(" ")), None)
        text = "\n".join(kept[:start] + (kept[end:] if end else []))
    with pytest.raises(rt.SceneError) as caught:
        rt.Scene.parse(f"{text}\n{own}\n", "x.yaml")
    wording(str(caught.value))


@pytest.mark.parametrize("of", types_of(AnyIntegrator), ids=name_of)
def test_integrators_that_follow_no_media_say_so(of):
    for part in ("media", "materials"):
        scene = rt.Scene.parse(BASE)
        if part == "materials":
            scene = scene.changed(media={})
        assert scene.has_media
        if of in (rt.Path, rt.RayCast):
            assert scene.changed(integrator=of(), sampler=None).integrator == of()
        else:
            with pytest.raises(rt.SceneError, match="expected 'path', or 'ray_cast'"):
                scene.changed(integrator=of(), sampler=None)
            with pytest.raises((rt.SceneError, ValueError), match="expected 'path'"):
                scene.radiance([[0.0, 0.0, 5.0]], [[0.0, 0.0, -1.0]], integrator=of())


def test_a_row_for_each_pair_of_media():
    scene = rt.Scene.parse(BASE).changed(
        media={
            "fog": rt.Homogeneous(sigma_t=1, albedo=1),
            "ink": rt.Homogeneous(sigma_t=1, albedo=0),
        },
        groups={"g": (rt.Sphere(material="clay", exterior="ink"),)},
        shapes=(
            rt.Sphere(),
            rt.Sphere(interior="fog"),
            rt.Sphere(material="edge", interior="fog", exterior="ink"),
            rt.Sphere(material="clay", interior="fog"),
            rt.Box(material="clay", interior="fog"),
            rt.Difference(
                of=(rt.Box(), rt.Sphere(material="edge")), material="clay", interior="ink"
            ),
            rt.Instance(group="g"),
        ),
    )
    found = boundaries(scene)
    assert [*found][:3] == [Boundary("edge"), Boundary("clay"), Boundary(None)]
    assert {*found} - {*[*found][:3]} == {
        Boundary(None, "fog"),
        Boundary("edge", "fog", "ink"),
        Boundary("clay", "fog"),
        Boundary("clay", "ink"),
        Boundary("edge", "ink"),
        Boundary("clay", None, "ink"),
    }
    media = media_of(scene)
    sides = {b: (int(media.inside[row]), int(media.outside[row])) for b, row in found.items()}
    assert sides[Boundary("clay")] == (UNCHANGED, UNCHANGED)
    assert sides[Boundary(None, "fog")] == (0, VACUUM)
    assert sides[Boundary("edge", "fog", "ink")] == (0, 1)
    assert sides[Boundary("clay", None, "ink")] == (VACUUM, 1)
    assert [bool(media.passes[row]) for row in found.values()] == [
        boundary.material == "edge" for boundary in found
    ]
    assert len(scene.tables.materials.kind) == len(found)


def test_lamps_that_bound_media_are_lamps():
    """Their rows are others than that of their material: the light is the same."""
    lamp = {"lamp": rt.Emissive(radiance=(3, 2, 1))}
    clear = {"clear": rt.Homogeneous(sigma_t=0.0, albedo=0.0)}
    pictures = []
    for sides in ({}, {"interior": "clear"}, {"exterior": "clear"}):
        scene = rt.Scene(
            film=rt.Film(width=8, height=6),
            camera=rt.Perspective(eye=(0, 1, 4), target=(0, 0, 0)),
            sampler=rt.Sobol(spp=8),
            materials=lamp,
            media=clear,
            shapes=(
                rt.Sphere(radius=0.3, material="lamp", **sides),
                rt.Rectangle(transform=({"scale": 3}, {"translate": (0, 0, -1)}), **sides),
            ),
        )
        pictures.append(rt.render(scene).colour)
        assert len(scene.light_sources().shape) == 1
    assert pictures[0].max() > 1.0
    assert all(np.array_equal(pictures[0], other) for other in pictures[1:])

"""Names of what a scene does not define, and what does not fit: all are told, of each part."""

import re

import pytest

import reference_rt as rt

NAMES = [
    """
textures:
  both: {type: product, of: [t1, t2]}
materials:
  glossy: {type: rough_conductor, eta: 1, k: 2, reflectance: t3, alpha: [t4, t5]}
  mixed: {type: blend, weight: t6, first: m1, second: m2}
  lamp: {type: emissive, radiance: t7, base: m3}
""",
    """
media: {fog: {type: homogeneous, sigma_t: 1, albedo: 0.5}}
shapes:
  - {type: instance, group: g1}
  - {type: union, material: m1, of: [{type: sphere, material: m2}, {type: box, material: m3}]}
groups:
  chairs:
    - {type: sphere, material: m4, interior: d1, exterior: d2}
lights:
  - {type: projector, irradiance: t1, origin: [0, 0, 0], target: [0, 0, 1], fov: 20}
camera: {type: perspective, medium: d3}
""",
]


def problems_of(text: str) -> list[rt.SceneError]:
    with pytest.raises(rt.SceneError) as caught:
        rt.Scene.parse(text)
    return [caught.value, *caught.value.others]


@pytest.mark.parametrize("text", NAMES)
def test_every_name_of_nothing_is_told(text):
    told = [
        re.match(r"there is no (?:texture|material|group|medium) '(\w+)'", one.message)
        for one in problems_of(text)
    ]
    assert [name[1] for name in told if name] == re.findall(r"\b[tmdg][1-9]\b", text)


def test_what_does_not_fit_is_told_beside_names_of_nothing():
    """Of a product's factors, an instance and an integrator on a grid."""
    problems = problems_of("""
sampler: {type: grid}
integrator: {type: direct}
textures:
  both: {type: product, of: [t1, both]}
materials:
  lamp: {type: emissive, radiance: 1}
shapes:
  - {type: instance, group: g1, material: lamp}
lights:
  - {type: constant, radiance: 1}
""")
    assert [one.path for one in problems] == [
        ("shapes", 0, "group"),
        ("shapes", 0, "material"),
        ("textures", "both", "of", 0),
        ("textures", "both", "of", 1),
        ("lights", 0),
        ("materials", "lamp"),
    ]


def test_all_circles_of_materials_are_told():
    problems = problems_of("""
materials:
  a: {type: mask, base: b, opacity: 0.5}
  b: {type: mask, base: a, opacity: 0.5}
  c: {type: two_sided, base: c}
""")
    assert [one.path for one in problems] == [("materials", name) for name in "abc"]


FILES = """
textures:
  a: {type: bitmap, file: no1.png}
  b: {type: bitmap, file: no2.png}
groups:
  inner:
    - {type: mesh, file: no3.ply}
    - {type: mesh, file: no4.ply}
  outer:
    - {type: instance, group: inner}
    - {type: instance, group: inner}
    - {type: union, of: [{type: mesh, file: no5.ply}, {type: mesh, file: no6.ply}]}
shapes:
  - {type: instance, group: outer}
  - {type: instance, group: inner}
  - {type: mesh, file: no7.ply}
  - {type: difference, of: [{type: mesh, file: no8.ply}, {type: mesh, file: no9.ply}]}
lights:
  - {type: environment_map, file: no0.exr}
"""


def test_every_file_that_is_missing_is_told_once():
    """Of groups, solids and lights, too; of a group that is drawn several times once."""
    with pytest.raises(rt.SceneError) as caught:
        rt.build_tables(rt.Scene.parse(FILES))
    told = " ".join(one.message for one in (caught.value, *caught.value.others))
    assert re.findall(r"\bno\d", told) == re.findall(r"\bno\d", FILES)


def test_a_group_is_looked_into_once_however_often_it_is_drawn():
    """Each level doubles the copies."""
    levels = "".join(
        f"  g{k}: [{{type: instance, group: g{k + 1}}}, {{type: instance, group: g{k + 1}}}]\n"
        for k in range(60)
    )
    scene = rt.Scene.parse(
        f"groups:\n{levels}  g60: [{{type: mesh, file: no.ply}}]\n"
        "shapes: [{type: instance, group: g0}]\n"
    )
    with pytest.raises(rt.SceneError) as caught:
        rt.build_tables(scene)
    assert caught.value.path == ("groups", "g60", 0)
    assert not caught.value.others


def test_every_material_that_creates_light_is_told():
    scene = rt.Scene.parse("""
materials:
  a: {type: phong, diffuse: 0.9, specular: 0.9}
  b: {type: diffuse}
  c: {type: phong, diffuse: 0.8, specular: 0.9}
""")
    with pytest.raises(rt.SceneError) as caught:
        rt.build_tables(scene)
    told = [one.path for one in (caught.value, *caught.value.others)]
    assert told == [("materials", "a"), ("materials", "c")]

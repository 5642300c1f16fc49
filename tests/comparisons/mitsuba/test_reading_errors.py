"""What our reader of Mitsuba scenes refuses, and how it says so; hostile files."""

import random
import re
import warnings
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from comparisons.mitsuba.included import MOST_NESTED
from comparisons.translator.reading import read_dict, read_file
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import SceneError, SceneWarning

WHOLE = """<scene version="3.0.0">
  <default name="spp" value="16"/>
  <integrator type="path"><integer name="max_depth" value="5"/></integrator>
  <sensor type="perspective">
    <float name="fov" value="40"/>
    <transform name="to_world"><lookat origin="0, 1, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
    <sampler type="independent"><integer name="sample_count" value="$spp"/></sampler>
    <film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="24"/>
      <rfilter type="tent"/></film>
  </sensor>
  <bsdf type="twosided" id="clay"><bsdf type="diffuse">
    <rgb name="reflectance" value="0.2, 0.3, 0.4"/></bsdf></bsdf>
  <shape type="sphere"><ref id="clay"/><point name="center" x="0" y="0" z="0"/></shape>
  <shape type="rectangle">
    <transform name="to_world"><scale value="2"/><rotate x="1" angle="-90"/>
      <translate y="-1"/></transform>
    <bsdf type="roughplastic"><string name="distribution" value="ggx"/></bsdf></shape>
  <emitter type="constant"><rgb name="radiance" value="0.5"/></emitter>
</scene>
"""


def read(tmp_path: Path, text: str | bytes, **defaults: str) -> Scene:
    path = tmp_path / "scene.xml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_file(path, Scene, defaults)


def refusal(tmp_path: Path, text: str | bytes, **defaults: str) -> str:
    """The message, which is one line."""
    with pytest.raises(SceneError) as caught:
        read(tmp_path, text, **defaults)
    message = str(caught.value)
    assert "\n" not in message
    return message


def element(text: str) -> str:
    return f'<scene version="3.0.0">\n  {text}\n</scene>'


def test_a_whole_scene(tmp_path):
    scene = read(tmp_path, WHOLE)
    assert scene.name == "scene"
    assert scene.resolved_sampler.spp == 16
    assert (scene.film.width, scene.film.height, scene.film.filter.type) == (32, 24, "tent")
    assert scene.integrator.max_depth == 5
    assert list(scene.materials) == ["diffuse", "clay", "roughplastic"]
    assert [s.material for s in scene.shapes] == ["clay", "roughplastic"]
    assert read(tmp_path, WHOLE, spp="64").resolved_sampler.spp == 64


def on_sphere(bsdf: str) -> str:
    return f'<shape type="sphere"><bsdf {bsdf}</bsdf></shape>'


def shape(inside: str, plugin: str = "sphere") -> str:
    return f'<shape type="{plugin}">{inside}</shape>'


VOLPATH = '<integrator type="volpath"/>'


def medium(inside: str) -> str:
    return VOLPATH + shape(f'<medium type="homogeneous" name="interior">{inside}</medium>')


def sensor(inside: str) -> str:
    return f'<sensor type="perspective">{inside}</sensor>'


def map_of(inside: str) -> str:
    return f'<transform name="to_world">{inside}</transform>'


REFUSED = {
    '<sensor type="perspective"/><bsdf type="hair"/>': "",  # nobody uses it
    shape('<bsdf type="hair"/>'): "scene.xml:2: column 25: bsdf 'hair': is not supported; expected "
    "one of: blendbsdf,",
    shape("", "sdfgrid"): "scene.xml:2: column 4: shape 'sdfgrid': is not supported",
    shape("", "nonsense"): "shape 'nonsense': is not supported",
    shape('<float name="radios" value="2"/>'): "'radios' is not supported here, or unknown",
    shape('<bsdf type="diffuse"/><bsdf type="plastic"/>'): "has 2 elements",
    shape('<float name="radius" value="-1"/>'): "'radius' is -1",
    shape('<float name="radius" value="nan"/>'): "finite",
    shape('<string name="radius" value="big"/>'): "is no number",
    shape("", "obj"): "has no 'filename'",
    shape('<string name="filename" value="none.obj"/>', "obj"): "there is no file",
    shape("", "instance"): "has no shape group",
    shape("", "shapegroup"): "has no shapes",
    shape(map_of('<scale x="0"/>')): "flat",
    shape('<vector name="to_world" x="1" y="2" z="3"/>'): "'to_world' is no transform",
    shape(map_of('<rotate x="1" y="1" angle="30"/>')): "no unit vector",
    shape(map_of('<scale x="1" y="2" z="1"/>')): "makes it an ellipsoid",
    on_sphere('type="twosided">'): "has 0 nested BSDFs",
    on_sphere('type="twosided"><bsdf type="dielectric"/>'): "transmits",
    on_sphere('type="diffuse"><rgb name="reflectance" value="2 0 0"/>'): "'diffuse': reflectance: ",
    on_sphere('type="conductor"><string name="material" value="Xx"/>'): "'material' is 'Xx'",
    on_sphere('type="dielectric"><string name="int_ior" value="jam"/>'): "'int_ior' is 'jam'",
    on_sphere('type="bumpmap"><bsdf type="diffuse"/>'): "has no texture",
    VOLPATH + shape('<medium type="heterogeneous" name="interior"/>'): "the same everywhere",
    VOLPATH + shape('<medium type="homogeneous" name="inside"/>'): "interior, exterior",
    medium('<boolean name="sample_emitters" value="false"/>'): "'sample_emitters' is false",
    medium('<volume name="sigma_t" type="gridvolume"/>'): "volume 'gridvolume'",
    medium('<float name="albedo" value="1.5"/>'): "albedo",
    medium('<rgb name="sigma_s" value="1"/>'): "'sigma_s'",
    medium('<phase type="sggx"/>'): "blendphase, hg, isotropic, rayleigh",
    medium('<phase type="hg"><float name="g" value="1"/></phase>'): "'hg': g",
    medium('<phase type="blendphase"/>'): "has 0 phase functions",
    shape('<emitter type="point"/>'): "expected 'area'",
    '<emitter type="projector">' + map_of('<scale x="-1"/>') + "</emitter>": "mirrors the image",
    '<emitter type="sunsky"><texture name="albedo" type="checkerboard"/></emitter>': (
        "'albedo' is a nested element"
    ),
    '<emitter type="point">'
    + map_of('<translate x="1" y="0" z="0"/>')
    + '<point name="position" x="1" y="2" z="3"/></emitter>': "both 'position' and 'to_world'",
    sensor("") + 2 * '<emitter type="constant"/>': "more than one environment",
    '<emitter type="constant"><spectrum name="radiance" type="blackbody">'
    '<float name="temperature" value="3000"/></spectrum></emitter>': "rgb variants cannot use it",
    '<integrator type="stokes"/>': "integrator 'stokes': is not supported",
    '<integrator type="path"/><integrator type="path"/>': "second integrator",
    '<integrator type="path"><integer name="max_depth" value="-2"/></integrator>': "-1 (no end)",
    VOLPATH + shape('<bsdf type="mask"><bsdf type="diffuse"/></bsdf>'): "shadow rays",
    '<sensor type="batch"/>': "sensor 'batch': is not supported",
    sensor('<float name="fov" value="200"/>'): "'fov' is 200",
    sensor('<string name="focal_length" value="long"/>'): "50mm",
    sensor(map_of('<scale value="3"/>')): "which Mitsuba refuses, too",
    on_sphere(
        'type="normalmap"><texture type="bitmap" name="normalmap"><string name="filename" '
        'value="scene.xml"/></texture><bsdf type="diffuse"/><boolean name="flip_invalid_normals" '
        'value="false"/><boolean name="use_shadowing_function" value="false"/>'
    )
    + sensor(map_of('<scale x="-1" y="1" z="1"/>')): "mirrors the picture",
    '<sensor type="thinlens"/>': "has no 'aperture_radius'",
    sensor('<film type="specfilm"/>'): "expected hdrfilm",
    sensor('<film type="hdrfilm"><integer name="crop_width" value="900"/></film>'): "not inside",
    sensor('<film type="hdrfilm"><rfilter type="odd"/></film>'): "'odd': is not supported",
    sensor('<sampler type="odd"/>'): "sampler 'odd'",
}


@pytest.mark.parametrize("text", REFUSED)
def test_refusals_name_place_and_plugin(text, tmp_path):
    if not REFUSED[text]:
        read(tmp_path, element(text))
        return
    message = refusal(tmp_path, element(text))
    assert REFUSED[text] in message
    assert f"{tmp_path / 'scene.xml'}:" in message


BROKEN = {
    "": "No document element",
    "no xml": "No document element",
    '<scene version="3.0.0"><shape type="sphere"></scene>': "tags mismatch",
    '<scene version="3.0.0"><nonsense/></scene>': "nonsense",
    '<bsdf version="3.0.0" type="diffuse"/>': "is no scene",
    element('<ref id="nobody"/>'): 'unresolved reference to "nobody"',
    element('<bsdf type="mask" id="a"><ref id="a"/></bsdf>'): "circular reference",
    element(
        '<bsdf type="mask" id="a"><ref id="b"/></bsdf><bsdf type="mask" id="b"><ref id="a"/></bsdf>'
    ): "circular reference",
    element('<shape type="sphere"><float name="radius" value="$r"/></shape>'): "$r",
    element('<include filename="none.xml"/>'): "none.xml",
    element('<include filename="scene.xml"/>'): "include",
    element("<bsdf type='mask'>" * MOST_NESTED + "</bsdf>" * MOST_NESTED): "nest deeper",
    element("<bsdf type='mask'>" * 300_000): "nest deeper",
    '<!DOCTYPE a [<!ENTITY x SYSTEM "/etc/passwd">]>' + element('<string name="&x;"/>'): "",
}


@pytest.mark.parametrize("text", BROKEN, ids=range(len(BROKEN)))
def test_broken_files_are_refused(text, tmp_path):
    assert BROKEN[text] in refusal(tmp_path, text)


def test_unused_defaults_are_refused(tmp_path):
    assert "$nobody" in refusal(tmp_path, WHOLE, nobody="3")


def test_a_missing_file_and_a_folder(tmp_path):
    with pytest.raises(SceneError, match=r"none\.xml: cannot be read"):
        read_file(tmp_path / "none.xml", Scene)
    (tmp_path / "folder.xml").mkdir()
    with pytest.raises(SceneError, match=r"folder\.xml: cannot be read"):
        read_file(tmp_path / "folder.xml", Scene)


def test_errors_in_includes_name_the_included_file(tmp_path):
    (tmp_path / "part.xml").write_text(element('<shape type="sphere"><bsdf type="hair"/></shape>'))
    message = refusal(tmp_path, element('<include filename="part.xml"/>'))
    assert "part.xml:2: column 25: bsdf 'hair'" in message
    (tmp_path / "part.xml").write_text(element("<oh"))
    assert "part.xml" in refusal(tmp_path, element('<include filename="part.xml"/>'))


def test_dictionaries_name_the_node():
    with pytest.raises(SceneError, match=r'dictionary node "a\.b": bsdf \'hair\''):
        read_dict({"type": "scene", "a": {"type": "sphere", "b": {"type": "hair"}}}, Scene)
    with pytest.raises(SceneError, match="is no scene"):
        read_dict({"type": "sphere"}, Scene)
    with pytest.raises(SceneError):
        read_dict({"type": "scene", "a": {"no": "type"}}, Scene)


def test_objects_of_mitsuba_are_refused():
    import mitsuba as mi

    from comparisons.mitsuba.parse import scalar

    with scalar():
        scene = {"type": "scene", "a": {"type": "sphere", "b": mi.load_dict({"type": "diffuse"})}}
        with pytest.raises(SceneError, match="expected its dictionary"):
            read_dict(scene, Scene)


def test_notes_are_warnings(tmp_path):
    two = WHOLE.replace("</scene>", '<sensor type="perspective"/></scene>')
    with pytest.warns(SceneWarning, match="is the first of 2 sensors"):
        read(tmp_path, two)


@pytest.mark.parametrize("planes", [(1, 1), (2, 1), (0, 1), (-1, 5)])
def test_clipping_planes_in_another_order_are_refused(tmp_path, planes):
    """As by Mitsuba."""
    values = zip(("near_clip", "far_clip"), planes, strict=True)
    text = "".join(f'<float name="{name}" value="{value}"/>' for name, value in values)
    with pytest.raises(SceneError, match="expected near_clip above 0 and below far_clip"):
        read(tmp_path, WHOLE.replace('<float name="fov"', f'{text}<float name="fov"'))


DAMAGE: list[Any] = [
    lambda text, r: text[: r.randrange(len(text))],
    lambda text, r: _cut(text, r, r.choice(["", "<", ">", '"', "&", "\0", "-1", "nan", "$"])),
    lambda text, r: _lines(text, r),
    *[lambda text, r: _value(text, r)] * 12,
]


def _value(text: str, r: random.Random) -> str:
    """With another value of an attribute: one of the scene's own, or an extreme one."""
    places = [found.span(1) for found in re.finditer('"([^"]*)"', text)] or [(0, 0)]
    (a, b), (c, d) = r.choice(places), r.choice(places)
    extremes = ["", "-1", "0", "1e30", "1e-30", "9999999999", "nan", "1 2 3", "$spp", "\u00e9"]
    return text[:a] + r.choice([text[c:d], r.choice(extremes)]) + text[b:]


def _cut(text: str, r: random.Random, by: str) -> str:
    at = r.randrange(len(text))
    return text[:at] + by + text[at + r.randrange(8) :]


def _lines(text: str, r: random.Random) -> str:
    lines = text.splitlines()
    r.shuffle(lines)
    return "\n".join(lines)


def read_damaged(tmp_path: Path, seed: int) -> bool:
    """Whether a damaged scene is read; False if it is refused in one line."""
    r = random.Random(seed)
    text = WHOLE
    for _ in range(r.randint(1, 3)):
        text = r.choice(DAMAGE)(text, r) or " "
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        try:
            read(tmp_path, text.encode("utf-8", "replace"))
        except SceneError as error:
            return "\n" in str(error)
    return True


def test_damaged_files_never_crash(tmp_path):
    found = [read_damaged(tmp_path, seed) for seed in range(400)]
    assert 5 < sum(found) < 380


STEPS = (
    '<translate x="1" y="2" z="3"/>',
    '<translate value="1, 2, 3"/>',
    '<scale x="1" y="2" z="3"/>',
    '<scale value="2"/>',
    '<rotate x="1" y="0" z="0" angle="30"/>',
    '<rotate value="0, 0, 1" angle="30"/>',
    '<matrix value="1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"/>',
    '<lookat origin="0, 0, 1" target="0, 0, 0" up="0, 1, 0"/>',
)


@pytest.mark.parametrize("step", STEPS)
def test_steps_of_transforms_with_another_number_of_numbers(tmp_path, step):
    """None, two, or a word, in each attribute: read as Mitsuba reads it, or an error."""
    for attribute in re.findall(r'\w+="[^"]*"', step):
        for value in ("", " ", "1 2", "1,2,3,4,5", "one"):
            damaged = step.replace(attribute, f'{attribute.partition("=")[0]}="{value}"')
            shape = f'<shape type="sphere"><transform name="to_world">{damaged}</transform></shape>'
            text = WHOLE.replace("</scene>", f"{shape}</scene>")
            with warnings.catch_warnings(), suppress(SceneError):
                warnings.simplefilter("ignore", SceneWarning)
                read(tmp_path, text)


@pytest.mark.slow
def test_ten_thousand_damaged_files_never_crash(tmp_path):
    for seed in range(400, 10_400):
        read_damaged(tmp_path, seed)

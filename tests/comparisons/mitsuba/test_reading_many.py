"""Scenes of many elements, such as clouds of 10,000 spheres with a material each: the work for each
element does not grow with their number.  And where an element is in its file."""

from pathlib import Path
from typing import Any

import pytest

from comparisons.mitsuba.backend import imported
from comparisons.mitsuba.node import Reading
from reference_rt.rendering.scene import Scene

CAMERA = """<sensor type="perspective"><film type="hdrfilm"/><transform name="to_world">
<lookat origin="2,2,2" target="0,0,0" up="0,0,1"/></transform></sensor>"""

BALL = """<shape type="sphere"><float name="radius" value="0.01"/>
<transform name="to_world"><rotate y="1" angle="{k}"/><translate x="{k}" y="1" z="2"/></transform>
<bsdf type="diffuse"><rgb name="reflectance" value="0.{k:04}, 0.2, 0.3"/></bsdf></shape>
"""


class Counted(dict[str, Any]):
    """A dictionary that counts how often it is asked."""

    asked = 0

    def __contains__(self, key: object) -> bool:
        self.asked += 1
        return super().__contains__(key)


def test_names_of_many_materials_are_found_at_once() -> None:
    taken, names = Counted(diffuse_7=1), Reading(parsed=None, material_name=None)  # type: ignore[arg-type]
    for _ in range(1000):
        taken[names.unused("", "diffuse", taken)] = 1
    assert len(taken) == 1001  # each was new
    assert {"diffuse", "diffuse_2", "diffuse_8", "diffuse_1001"} <= set(taken)
    assert taken.asked <= 2 * 1000 + 1
    # Numbers of other names and in other tables begin anew.
    assert names.unused("diffuse_2", "x", taken) == "diffuse_2_2"
    assert names.unused("", "diffuse", {"diffuse": 1}) == "diffuse_2"


def test_many_shapes_are_read_without_a_search_for_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Mitsuba's `file_location` reads the file anew, every time."""

    def refused(*_: Any) -> str:
        raise AssertionError("the place of an element was asked for")

    monkeypatch.setattr(imported().parser, "file_location", refused)
    path = tmp_path / "scene.xml"
    balls = "".join(BALL.format(k=k) for k in range(300))
    path.write_text(f'<scene version="3.0.0">{CAMERA}{balls}</scene>')
    scene = Scene.load(path)
    assert len(scene.shapes) == len(scene.materials) == 300
    for k, shape in enumerate(scene.shapes):
        assert shape.radius == 0.01
        assert shape.transform[1].translate == (k, 1.0, 2.0)
        assert scene.materials[shape.material].reflectance[0] == float(f"0.{k:04}")


ENCODINGS = {
    "utf-8": "",
    "utf-8-sig": "",
    "utf-16": '<?xml version="1.0" encoding="UTF-16"?>\n',
    "latin-1": '<?xml version="1.0" encoding="ISO-8859-1"?>\n',
    "ascii": "",
}


@pytest.mark.parametrize("ends", ["\n", "\r\n"])
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_the_authors_steps_are_found_in_every_encoding(
    tmp_path: Path, encoding: str, ends: str
) -> None:
    text = "plain" if encoding == "ascii" else "café, Größe, ½"
    included = f"""<scene version="3.0.0"><!-- {text} --><shape type="cube">
<transform name="to_world"><rotate x="1" angle="50"/><translate z="2"/></transform></shape></scene>
"""
    written = f"""{ENCODINGS[encoding]}<scene version="3.0.0"><!-- {text} -->
<!-- {text} --> <include filename="inner.xml"/>
{CAMERA}
<!-- {text} --> <shape
   type="cube" id="{text}"> <transform name="to_world">
  <rotate y="1" angle="30"/> <scale value="0.5"/></transform></shape>
</scene>"""
    for name, content in (("inner.xml", ENCODINGS[encoding] + included), ("outer.xml", written)):
        (tmp_path / name).write_bytes(content.replace("\n", ends).encode(encoding))
    scene = Scene.load(tmp_path / "outer.xml")
    steps = [[step.model_dump() for step in shape.transform] for shape in scene.shapes]
    assert [list(shape) for shape in steps[0]] == [["rotate"], ["translate"]]
    assert [list(shape) for shape in steps[1]] == [["rotate"], ["scale"]]
    assert steps[0][0]["rotate"]["degrees"] == 50.0
    assert steps[1][0]["rotate"]["degrees"] == 30.0
    assert scene.camera.eye == (2.0, 2.0, 2.0)
    assert scene.camera.target == (0.0, 0.0, 0.0)

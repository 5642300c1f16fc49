"""Wrong scenes: exit code 3 and one line with file, line, keys and what was expected."""

import pytest

import reference_rt as rt
from reference_rt.scene import yaml_text

SHAPE = "shapes:\n  - type: sphere\n    "
BOX = "shapes:\n  - type: box\n    transform: "
STEP = "expected one of 'translate', 'scale', 'rotate', 'matrix'"
LIGHT = "lights:\n  - type: point\n    position: [0, 0, 0]\n    intensity: "

# (scene, the line that is told, keys, and the beginning of the rest)
WRONG = {
    "unknown key": ("film: {}\ncolour: 3", 2, "colour", "unknown key"),
    "unknown key, deep": (SHAPE + "colour: 3", 3, "shapes[0].colour", "unknown key"),
    "float for int": ("film: {width: 4.5}", 1, "film.width", "expected a valid integer, got 4.5"),
    "text for int": ("film: {width: '4'}", 1, "film.width", "expected a valid integer, got '4'"),
    "bool for int": ("film: {width: true}", 1, "film.width", "expected a valid integer, got True"),
    "number for keys": ("film: 7", 1, "film", "expected keys with values"),
    "list for keys": ("film: [1]", 1, "film", "expected keys with values"),
    "keys for list": ("shapes: {a: 1}", 1, "shapes", "expected a list"),
    "zero width": ("film:\n  width: 0", 2, "film.width", "expected greater than or equal to 1"),
    "endless width": ("film: {width: 1" + "0" * 400 + "}", 1, "film.width", "expected less than"),
    "negative radius": (SHAPE + "radius: -1", 3, "shapes[0].radius", "expected greater than 0"),
    "NaN": (SHAPE + "radius: .nan", 3, "shapes[0].radius", "expected a finite number, got nan"),
    "infinity": (SHAPE + "radius: .inf", 3, "shapes[0].radius",
     "expected a finite number, got inf"),
    "overflow": (SHAPE + "radius: 1e400", 3, "shapes[0].radius", "expected a finite number"),
    "NaN in a vector": (SHAPE + "center: [0, .nan, 0]", 3, "shapes[0].center[1]",
     "expected a finite"),
    "long integer": (SHAPE + "center: [1" + "0" * 400 + ", 0, 0]", 3, "shapes[0].center",
     "expected finite"),
    "two numbers": (SHAPE + "center: [1, 2]", 3, "shapes[0].center", "expected three numbers"),
    "a word": (SHAPE + "radius: one", 3, "shapes[0].radius", "expected a valid number, got 'one'"),
    "light of NaN": (LIGHT + ".nan", 4, "lights[0].intensity", "expected numbers of at least 0"),
    "light of infinity": (LIGHT + ".inf", 4, "lights[0].intensity", "expected a finite number"),
    "negative light": (LIGHT + "-1", 4, "lights[0].intensity", "expected numbers of at least 0"),
    "missing key": ("lights:\n  - {type: point, intensity: 1}", 2, "lights[0].position", "missing"),
    "unknown type": ("camera: {type: fisheye}", 1, "camera",
     "unknown type 'fisheye'; expected one of: "),
    "missing type": ("materials:\n  a: {reflectance: 1}", 2, "materials.a",
     "missing 'type'; expected"),
    "flat scale": (BOX + "[{scale: [1, 0, 1]}]", 2, "shapes[0]", "the transform is singular"),
    "flat matrix": (BOX + "[{matrix: [[1, 2, 0, 0], [2, 4, 0, 0], [0, 0, 1, 0]]}]", 2, "shapes[0]",
     "the transform is singular"),
    "transform of numbers": (BOX + "[1]", 3, "shapes[0].transform[0]", STEP),
    "transform of lists": (BOX + "[[1, 2]]", 3, "shapes[0].transform[0]", STEP),
    "transform of nothing": (BOX + "[null]", 3, "shapes[0].transform[0]", STEP),
    "unknown step": (BOX + "[{skew: 1}]", 3, "shapes[0].transform[0]", STEP),
    "steps as keys": (BOX + "{scale: 2}", 3, "shapes[0].transform", "expected a list"),
    "no axis": (BOX + "[{rotate: {axis: [0, 0, 0], degrees: 3}}]", 3,
     "shapes[0].transform[0].rotate.axis", "expected a direction"),
    "NaN in a matrix": (BOX + "[{matrix: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, .nan, 0]]}]", 3,
     "shapes[0].transform[0].matrix[2][2]", "expected a finite"),
    "flat triangle": ("shapes:\n  - {type: triangle, v0: [0, 0, 0], v1: [1, 1, 1], v2: [2, 2, 2]}",
     2, "shapes[0]", "the triangle has no area; expected"),
    "unknown material": ("materials: {red: {type: mirror}}\n" + SHAPE + "material: blue", 4,
     "shapes[0].material", "there is no material 'blue'; expected one of: 'red'"),
    "unknown base": ("materials:\n  a: {type: emissive, radiance: 1, base: c}", 2,
     "materials.a.base", "there is no material 'c'; expected one of: 'a'"),
    "emissive of emissive": ("materials:\n  a: {type: emissive, radiance: 1, base: b}\n"
     "  b: {type: emissive, radiance: 1}", 2, "materials.a.base",
     "'b' is emissive itself; expected"),
    "emissive of itself": ("materials:\n  a: {type: emissive, radiance: 1, base: a}", 2,
     "materials.a.base", "'a' is emissive itself; expected"),
    "grid with path": ("integrator: {type: path}\nsampler: {type: grid}", 2, "sampler.type",
     "'path' needs random numbers, which 'grid' does not have; expected"),
    "grid not square": ("sampler: {type: grid, spp: 3}", 1, "sampler.spp",
     "expected a square number"),
    "camera at its target": ("camera: {type: perspective, target: [0, 0, 1]}", 1, "camera",
     "eye and target are the same point; expected"),
    "camera along up": ("camera: {type: perspective, up: [0, 0, 2]}", 1, "camera",
     "up is parallel to the view direction; expected"),
    "camera across space": (
     "camera: {type: perspective, eye: [1.0e308, 0, 0], target: [-1.0e308, 0, 0]}", 1, "camera",
     "eye and target are too far apart; expected"),
    "too wide": ("camera: {type: perspective, fov: 180}", 1, "camera.fov",
     "expected less than 180"),
    "deep tree": ("integrator: {type: whitted, max_depth: 5000}", 1, "integrator.max_depth",
     "expected less than or equal to 4096"),
    "empty": ("", 1, "", "expected keys such as"),
    "a list": ("- 1", 1, "", "expected keys such as"),
    "open bracket": ("film:\n  filter: [1, 2", 3, "",
     "malformed: while parsing a flow sequence, did"),
    "same key twice": ("film: {width: 4}\nfilm: {width: 5}", 2, "",
     "malformed: found duplicate key 'film'"),
    "two documents": ("film: {}\n---\nfilm: {}", 2, "",
     "malformed: expected a single document in the stream, but found another"),
    "no such anchor": ("shapes: *b", 1, "", "malformed: found undefined alias"),
    "python object": ("film: !!python/object/apply:os.system ['exit 1']", 1, "",
     "malformed: unknown tag '!!python/"),
    "python name": ("film: !!python/name:os.system", 1, "", "malformed: unknown tag '!!python/"),
    "a list in itself": ("shapes: &a [*a]", 1, "", "malformed: the alias 'a' is inside its"),
    "no number": ("description: !!float xyz", 1, "",
     "malformed: 'xyz' is no 'float', as its tag says"),
    "endless number": ("description: " + "9" * 5000, 1, "", "malformed: Exceeds the limit"),
    "nested": ("film: " + "[" * 5000 + "]" * 5000, 1, "", "malformed: nested too deeply"),
    "control character": ('description: "\x07"', 1, "", "malformed: control characters are"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_wrong_scene(name, refused, tmp_path):
    text, line, keys, rest = WRONG[name]
    file = tmp_path / "scene.yaml"
    file.write_text(text + "\n")
    said = refused(3, "render", str(file), "-o", str(tmp_path / "out.exr"), "--size", "4x4")
    where = f"{file}: " if line is None else f"{file}:{line}: "
    assert said.startswith(where + (f"{keys}: " if keys else "") + rest)


@pytest.mark.parametrize("suffix", [".yaml", ".json"])
def test_malformed_json_reports_the_line(suffix, refused, tmp_path):
    file = tmp_path / f"scene{suffix}"
    file.write_text('{\n  "film": {"width": 4},\n  "camera": {]\n}\n')
    assert refused(3, "explain", str(file)).startswith(f"{file}:3: malformed: ")


def test_files_that_are_no_scenes(refused, tmp_path):
    missing, text, binary = (tmp_path / n for n in ("no.yaml", "scene.txt", "bin.yaml"))
    assert refused(3, "explain", str(missing)) == (
        f"{missing}: cannot be read: No such file or directory; expected a scene file"
    )
    text.write_text("film: {}")
    assert refused(3, "explain", str(text)).startswith(f"{text}: is not a scene file; expected ")
    binary.write_bytes(bytes(range(128, 256)))
    assert refused(3, "explain", str(binary)) == f"{binary}: is not text; expected UTF-8"
    folder = tmp_path / "folder.yaml"
    folder.mkdir()
    assert "Is a directory" in refused(3, "explain", str(folder))


def test_a_billion_laughs(refused, tmp_path):
    """9^12 values through aliases, which nobody must unfold: it would never end."""
    laughs = ["description: &a0 [x, x, x, x, x, x, x, x, x]"]
    laughs += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 12)]
    file = tmp_path / "laughs.yaml"
    file.write_text("\n".join([*laughs, "shapes: *a11"]))
    assert refused(3, "explain", str(file)) == (
        f"{file}:7: malformed: aliases stand for more than {yaml_text.MOST_REPEATED} values"
    )


def test_tags_make_data_and_never_run(tmp_path):
    marker = tmp_path / "marker"
    with pytest.raises(rt.SceneError):
        rt.Scene.parse(f"film: !!python/object/apply:os.mkdir ['{marker}']")
    assert not marker.exists()


def test_errors_from_python_name_the_keys():
    with pytest.raises(rt.SceneError) as caught:
        rt.Scene(shapes=(rt.Sphere(material="blue"),))
    assert caught.value.path == ("shapes", 0, "material")
    flat = rt.Scene(shapes=(rt.Sphere(), rt.Triangle(v0=(0, 0, 0), v1=(1, 0, 0), v2=(2, 0, 0))))
    with pytest.raises(rt.SceneError, match=r"^shapes\[1\]: the triangle has no area"):
        rt.build_tables(flat)

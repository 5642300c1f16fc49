"""Parameters of Mitsuba's plugins that our reader leaves out, since they do not change the picture:
each is given two values, and Mitsuba's pictures are compared."""

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import comparisons
from comparisons.mitsuba.backend import mitsuba
from comparisons.translator.reading import read_dict
from reference_rt.core.arrays import FloatArray
from reference_rt.scene.model import SceneModel

REPLICATES = 8
"""Pictures of each value where random numbers differ."""

MOST = 6.0
"""Standard errors of 14 degrees of freedom: normal noise exceeds them with a chance of 3e-5."""


def scene(image: Path) -> dict[str, Any]:
    """With each element that has such a parameter; seen by a camera of rays that meet them all."""
    t = mitsuba().ScalarTransform4f()
    fog = {"type": "homogeneous", "sigma_t": 0.4, "albedo": {"type": "constvolume", "value": 0.7}}
    ball = {"type": "sphere", "radius": 0.5}
    return {
        "type": "scene",
        "integrator": {"type": "volpathmis", "max_depth": 4},
        "sensor": {
            "type": "perspective",
            "to_world": t.look_at([0, 1, 6], [0, 0, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": 12, "height": 8, "rfilter": {"type": "box"}},
            "sampler": {"type": "independent", "sample_count": 16},
        },
        "sky": {"type": "envmap", "filename": str(image), "scale": 0.2},
        "lamp": {
            "type": "rectangle",
            "to_world": t.translate([0, 2, 0]).rotate([1, 0, 0], 90).scale(0.5),
            "emitter": {"type": "area", "radiance": 40.0},
        },
        "cube": {
            "type": "cube",
            "to_world": t.translate([-1.5, 0, 0]).rotate([0, 1, 0], 30).scale(0.5),
            "bsdf": {
                "type": "diffuse",
                "reflectance": {"type": "bitmap", "filename": str(image)},
            },
        },
        "floor": {"type": "rectangle", "to_world": t.translate([0, -1, 0]).rotate([1, 0, 0], -90)},
        "cloud": {**ball, "bsdf": {"type": "null"}, "interior": fog},
        "group": {"type": "shapegroup", "one": ball},
        "copy": {
            "type": "instance",
            "to_world": t.translate([1.5, 0, 0]),
            "shapegroup": {"type": "ref", "id": "group"},
        },
    }


def moved() -> Any:
    return mitsuba().ScalarTransform4f().translate([0.3, 0.1, 0.2])


ORTHOGRAPHIC = {"sensor.type": "orthographic"}
METER = {
    "sensor.type": "radiancemeter",
    "sensor.origin": [0.0, 0.5, 6.0],
    "sensor.direction": [0.0, -0.1, -1.0],
    "sensor.film.width": 1,
    "sensor.film.height": 1,
}
GAUSSIAN = {"sensor.film.rfilter.type": "gaussian"}
ORTHOGONAL = {"sensor.sampler.type": "orthogonal", "sensor.sampler.sample_count": 25}

ROUNDING = 2.0 * 16 * 2.0**-24
"""Of a pixel's sum of 16 samples, whose order is that of Mitsuba's threads."""

SAME: list[tuple[str, Any, Any, dict[str, Any]]] = [
    ("allow_thread_reordering", False, True, {}),
    ("compact_acceleration_structures", False, True, {}),
    ("integrator.timeout", -1.0, 3600.0, {}),
    ("sensor.film.file_format", "openexr", "pfm", {}),
    ("sensor.film.pixel_format", "rgb", "rgba", {}),
    ("sensor.film.component_format", "float16", "float32", {}),
    ("sensor.film.banner", True, False, {}),
    ("sensor.film.compensate", False, True, {}),
    ("sensor.focus_distance", 1.0, 5.0, {}),
    ("sensor.focus_distance", 1.0, 5.0, ORTHOGRAPHIC),
    ("sensor.origin", [0.0, 0.5, 6.0], [0.0, 0.4, 5.0], METER),
    ("sensor.direction", [0.0, -0.1, -1.0], [0.1, 0.0, -1.0], METER),
    ("cube.face_normals", False, True, {}),
    ("floor.face_normals", False, True, {}),
    ("cube.silhouette_sampling_weight", 1.0, 5.0, {}),
    ("cube.bsdf.reflectance.accel", False, True, {}),
    ("cloud.interior.albedo.to_world", None, moved, {}),
    ("cloud.interior.has_spectral_extinction", False, True, {}),
    ("group.to_world", None, moved, {}),
]
"""Where it stands, two values (None: not given), what else the scene needs."""

SAMPLING: list[tuple[str, Any, Any, dict[str, Any]]] = [
    ("embree_use_robust_intersections", False, True, {}),
    ("integrator.use_spectral_mis", False, True, {}),
    ("integrator.samples_per_pass", 16, 8, {}),
    ("integrator.block_size", 4, 16, {}),
    ("sensor.film.sample_border", False, True, GAUSSIAN),
    ("sensor.shutter_open", 0.0, 0.25, {"sensor.shutter_close": 0.5}),
    ("sensor.shutter_close", 0.25, 0.5, {"sensor.shutter_open": 0.25}),
    ("sensor.sampler.strength", 2, 3, ORTHOGONAL),
    ("sky.mis_compensation", False, True, {}),
    ("sky.sampling_weight", 1.0, 3.0, {}),
    ("lamp.emitter.sampling_weight", 1.0, 3.0, {}),
]
"""Those by which random numbers change, and the expected picture does not."""

OF_OURS = {"components", "unlit"}
"""Of the plugin `whitted`, which is ours: how it follows rays, and layers of the film."""


def put(found: dict[str, Any], place: str, value: Any) -> None:
    *outer, last = place.split(".")
    for key in outer:
        found = found[key]
    if value is None:
        found.pop(last, None)
    else:
        found[last] = value() if callable(value) else value


def both(row: tuple[str, Any, Any, dict[str, Any]], image: Path) -> list[dict[str, Any]]:
    place, one, other, more = row
    made = []
    for value in (one, other):
        found = scene(image)
        for where, what in {**more, place: value}.items():
            put(found, where, what)
        made.append(found)
    return made


def picture(found: dict[str, Any], seed: int) -> FloatArray:
    mi = mitsuba()
    rendered = mi.render(mi.load_dict(found, optimize=False), seed=seed)
    return np.array(rendered, np.float64)[:, :, :3]


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path: Path = tmp_path_factory.mktemp("images") / "colours.png"
    rng = np.random.default_rng(3)
    Image.fromarray(rng.integers(20, 255, (8, 16, 3), dtype=np.uint8)).save(path)
    return path


def name(row: tuple[str, Any, Any, dict[str, Any]]) -> str:
    return " ".join((row[0], *(str(value) for value in row[3].values() if isinstance(value, str))))


@pytest.mark.parametrize("row", SAME, ids=name)
def test_the_same_picture(row: Any, image: Path) -> None:
    one, other = both(row, image)
    assert read_dict(one, SceneModel) == read_dict(other, SceneModel)
    first = picture(one, 1)
    np.testing.assert_allclose(picture(other, 1), first, rtol=ROUNDING)
    assert np.abs(picture(one, 2) / first - 1.0).max() > 1e3 * ROUNDING


def standard_errors(pictures: FloatArray) -> float:
    """Of the two values' means, the channel that is furthest off;  pictures: (2, R, h, w, 3)."""
    means = pictures.mean(axis=(2, 3))
    noise = np.sqrt(means.var(axis=1, ddof=1).sum(axis=0) / REPLICATES)
    return float(np.max(np.abs(np.diff(means.mean(axis=1), axis=0)[0]) / noise))


@pytest.mark.parametrize("row", SAMPLING, ids=name)
def test_the_same_expected_picture(row: Any, image: Path) -> None:
    made = both(row, image)
    assert read_dict(made[0], SceneModel) == read_dict(made[1], SceneModel)
    seeds = iter(range(2 * REPLICATES))
    found = [[picture(one, next(seeds)) for _ in range(REPLICATES)] for one in made]
    assert standard_errors(np.array(found)) < MOST


def test_a_parameter_that_changes_the_picture_is_seen(image: Path) -> None:
    """A lamp that is twice as bright."""
    made = both(("lamp.emitter.radiance", 40.0, 80.0, {}), image)
    found = [[picture(one, seed) for seed in range(REPLICATES)] for one in made]
    assert standard_errors(np.array(found)) > MOST


def ignored() -> Iterator[str]:
    """The parameters that the source of the readers names as such."""
    for path in Path(comparisons.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.Call):
                continue
            values = [k.value for k in node.keywords if k.arg == "ignored"]
            if isinstance(node.func, ast.Attribute) and node.func.attr == "ignore":
                values += node.args
            for value in values:
                for part in ast.walk(value):
                    if isinstance(part, ast.Constant):
                        yield str(part.value)


def test_every_parameter_that_is_left_out_is_above() -> None:
    tried = {row[0].split(".")[-1] for row in SAME + SAMPLING}
    assert set(ignored()) == tried | OF_OURS

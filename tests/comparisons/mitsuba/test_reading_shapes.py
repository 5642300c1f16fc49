"""Shapes and cameras of Mitsuba scenes as we read them, ray by ray against Mitsuba itself."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mitsuba_dicts import both_scenes, hits_of, rays_at

from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.scene import for_rays
from comparisons.rungs.rays.camera import camera_rays
from comparisons.translator.reading import read_dict
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import SceneError

FLOAT32 = 5e-4
"""Of unit normals and uv: float32 hits of shapes of size 1 from a distance of 4, whose positions
are off by some 1e-5, on surfaces curved with a radius of 0.3 or more."""

EDGE = 3
"""Of 1,000 rays, those that may hit on one side and miss on the other: within float32 of an
edge."""

QUAD = "v 0 0 0\nv 1 0 0\nv 1 1 0.2\nv 0 1 0\nv .5 .5 1\n"
FACES = "f 1/1 2/2 5/5\nf 2/2 3/3 5/5\nf 3/3 4/4 5/5\nf 4/4 1/1 5/5\n"
UV = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt .5 .5\n"
NORMALS = "vn 0 -1 .2\nvn 1 0 .3\nvn 0 0 1\n"
PLAIN_FACES = "f 1//1 2//2 5//3\nf 2//2 3//2 5//3\n"


@pytest.fixture(scope="module")
def meshes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of mesh files with and without normals, also as .ply and .serialized."""
    folder = tmp_path_factory.mktemp("meshes")
    (folder / "uv.obj").write_text(QUAD + UV + FACES)
    (folder / "normals.obj").write_text(QUAD + NORMALS + PLAIN_FACES)
    mi = mitsuba()
    for name in ("uv", "normals"):
        mesh = mi.load_dict({"type": "obj", "filename": str(folder / f"{name}.obj")})
        mesh.write_ply(str(folder / f"{name}.ply"))
    return folder


KINDS: dict[str, dict[str, Any]] = {
    "sphere": {"type": "sphere", "center": [0.2, 0.1, 0.0], "radius": 0.7},
    "rectangle": {"type": "rectangle"},
    "disk": {"type": "disk"},
    "cube": {"type": "cube"},
    "cylinder": {"type": "cylinder"},
    "oblique": {"type": "cylinder", "p0": [0.1, 0.2, -0.3], "p1": [0.4, -0.5, 0.8], "radius": 0.4},
    "obj": {"type": "obj", "filename": "uv.obj"},
    "obj_upside_down": {"type": "obj", "filename": "uv.obj", "flip_tex_coords": False},
    "obj_flat": {"type": "obj", "filename": "uv.obj", "face_normals": True},
    "obj_normals": {"type": "obj", "filename": "normals.obj"},
    "obj_flat_normals": {"type": "obj", "filename": "normals.obj", "face_normals": True},
    "ply": {"type": "ply", "filename": "uv.ply"},
    "ply_upside_down": {"type": "ply", "filename": "uv.ply", "flip_tex_coords": True},
    "ply_normals": {"type": "ply", "filename": "normals.ply"},
}


def turned(angle: float) -> Any:
    """A rotation about an axis that is none of the coordinates'."""
    axis = np.array([0.3, -0.5, 0.8])
    return mitsuba().ScalarTransform4f().rotate((axis / np.linalg.norm(axis)).tolist(), angle)


def similar() -> Any:
    return turned(50.0) @ mitsuba().ScalarTransform4f().translate([0.2, -0.1, 0.3]).scale(0.8)


def mirrored() -> Any:
    return similar() @ mitsuba().ScalarTransform4f().scale([-1, 1, 1])


def sheared() -> Any:
    return similar() @ turned(20.0) @ mitsuba().ScalarTransform4f().scale([0.6, 1.2, 0.9])


def mirrored_and_sheared() -> Any:
    return sheared() @ turned(70.0) @ mitsuba().ScalarTransform4f().scale([1, 1, -1])


MAPS = {
    "identity": lambda: mitsuba().ScalarTransform4f(),
    "similar": similar,
    "mirrored": mirrored,
    "sheared": sheared,
    "mirrored_and_sheared": mirrored_and_sheared,
}

ROUND = ("sphere", "cylinder", "oblique")
"""Shapes that Mitsuba has for similarities only."""


def case(kind: str, to_world: str, flip: bool, textured: bool, folder: Path) -> dict[str, Any]:
    shape = dict(KINDS[kind])
    if "filename" in shape:
        shape["filename"] = str(folder / shape["filename"])
    bsdf: dict[str, Any] = {"type": "diffuse"}
    if textured:
        bsdf["reflectance"] = {"type": "checkerboard"}
    return {"s": {**shape, "to_world": MAPS[to_world](), "flip_normals": flip, "bsdf": bsdf}}


@pytest.mark.cases(67)
@pytest.mark.parametrize("textured", [False, True], ids=["plain", "textured"])
@pytest.mark.parametrize("flip", [False, True], ids=["", "flipped"])
@pytest.mark.parametrize("to_world", MAPS)
@pytest.mark.parametrize("kind", KINDS)
def test_hits_are_those_of_mitsuba(kind, to_world, flip, textured, meshes):
    scene = case(kind, to_world, flip, textured, meshes)
    if kind in ROUND and "sheared" in to_world:
        with pytest.raises(SceneError, match="with a warning; expected"):
            read_dict({"type": "scene", **scene}, Scene)
        return
    inside_out = flip != (kind == "sphere" and to_world == "mirrored")
    if kind in ROUND and inside_out and textured:
        with pytest.raises(SceneError, match="inside out"):
            read_dict({"type": "scene", **scene}, Scene)
        return
    ours, theirs = both_scenes(scene)
    o, d = rays_at((0.0, 0.0, 0.0), 1.2, 1000, seed=1)
    hits = ours.intersect(o, d)
    t, n, ns, uv = hits_of(theirs, o, d)
    met = np.isfinite(hits.t) & np.isfinite(t)
    assert met.sum() > 20
    assert (np.isfinite(hits.t) != np.isfinite(t)).sum() <= EDGE
    np.testing.assert_allclose(hits.t[met], t[met], atol=FLOAT32)
    np.testing.assert_allclose(hits.ns[met], ns[met], atol=FLOAT32)
    # Mitsuba's own geometric normals may point to the other side of its shading normals.
    along = np.abs(np.einsum("ij,ij->i", hits.n[met], n[met]))
    np.testing.assert_allclose(along, 1.0, atol=FLOAT32)
    assert (np.einsum("ij,ij->i", hits.n[met], hits.ns[met]) > 0.0).mean() > 0.95
    if textured:
        off = np.abs(hits.uv[met] - uv[met])
        off = np.minimum(off, np.abs(1.0 - off))  # the seam of a round shape
        assert np.quantile(off, 0.99) < FLOAT32


@pytest.mark.parametrize("inner", ["identity", "mirrored"])
@pytest.mark.parametrize("outer", MAPS)
def test_instances_are_those_of_mitsuba(outer, inner, meshes):
    group = {
        "type": "shapegroup",
        "a": case("obj", inner, False, True, meshes)["s"],
        "b": {"type": "sphere", "radius": 0.3, "center": [-0.4, 0.3, 0.1]},
    }
    instances = {
        f"i{k}": {
            "type": "instance",
            "to_world": mitsuba().ScalarTransform4f().translate([0.6 * k, 0.3 * k, 0.2 * k])
            @ MAPS[outer](),
            "group": {"type": "ref", "id": "g"},
        }
        for k in range(2)
    }
    ours, theirs = both_scenes({"g": group, **instances})
    assert len(ours.groups) == 1
    o, d = rays_at((0.2, 0.0, 0.0), 1.2, 1000, seed=2)
    hits = ours.intersect(o, d)
    t, _, ns, _ = hits_of(theirs, o, d)
    met = np.isfinite(hits.t) & np.isfinite(t)
    # In groups Mitsuba's rays may pass between triangles (see comparisons.translator).
    assert met.sum() > 20
    assert (np.isfinite(hits.t) != np.isfinite(t)).sum() <= EDGE
    good = np.abs(hits.t[met] - t[met]) < FLOAT32
    assert (~good).sum() <= EDGE
    np.testing.assert_allclose(hits.ns[met][good], ns[met][good], atol=2 * FLOAT32)


# ---- cameras ------------------------------------------------------------------------------------

FILMS = {
    "wide": {"width": 40, "height": 30},
    "tall": {"width": 30, "height": 40},
    "window": {
        "width": 40,
        "height": 30,
        "crop_width": 11,
        "crop_height": 7,
        "crop_offset_x": 5,
        "crop_offset_y": 9,
    },
}

SENSORS: dict[str, dict[str, Any]] = {
    **{
        axis: {"type": "perspective", "fov": 37.0, "fov_axis": axis}
        for axis in ("x", "y", "diagonal", "smaller", "larger")
    },
    "default": {"type": "perspective"},
    "focal": {"type": "perspective", "focal_length": "35mm"},
    "shifted": {
        "type": "perspective",
        "fov": 50.0,
        "principal_point_offset_x": 0.1,
        "principal_point_offset_y": -0.2,
    },
    "lens": {"type": "thinlens", "fov": 50.0, "aperture_radius": 0.2, "focus_distance": 3.0},
    "orthographic": {"type": "orthographic"},
    "scaled": {"type": "orthographic", "scale": [2.0, 3.0, 1.5]},
}


@pytest.mark.parametrize("placed", [False, True], ids=["", "placed"])
@pytest.mark.parametrize("film", FILMS)
@pytest.mark.parametrize("sensor", SENSORS)
def test_rays_of_cameras_are_those_of_mitsuba(sensor, film, placed):
    mi = mitsuba()
    values = dict(SENSORS[sensor])
    place = mi.ScalarTransform4f()
    if placed:
        place = place.look_at([1, 2, 3], [0.3, -0.2, 0.4], [0.1, 1, 0.2])
    place = place @ mi.ScalarTransform4f().scale(values.pop("scale", [1.0, 1.0, 1.0]))
    values |= {"to_world": place, "film": {"type": "hdrfilm", **FILMS[film]}, "near_clip": 1e-6}
    ours = read_dict({"type": "scene", "sensor": values}, Scene)
    theirs = mi.load_dict(values)
    width, height = ours.film.width, ours.film.height
    assert [width, height] == list(theirs.film().crop_size())
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0.0, width, 100), rng.uniform(0.0, height, 100)

    def ray(place: Any) -> tuple[Any, ...]:
        point = mi.Point2f(place.x, place.y)
        found, _ = theirs.sample_ray_differential(0.0, 0.5, point, mi.Point2f(0.5, 0.5))
        return found.o, found.d

    o, d = for_rays(ray, np.column_stack([x / width, y / height, np.zeros(100)]))
    ours_o, ours_d = camera_rays(ours, x, y)
    np.testing.assert_allclose(ours_o, o, atol=1e-5)  # moved by the clipping plane, and float32
    np.testing.assert_allclose(ours_d, d, atol=2e-6)

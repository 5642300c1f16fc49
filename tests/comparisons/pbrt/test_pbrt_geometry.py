"""`convert -o scene.pbrt`: shapes and camera rays of the written file are where ours are."""

import numpy as np
import pytest
from builders import SCENES
from pbrt_reader import camera_rays, intersect, scene_of, written

from reference_rt.rendering.scene import Scene
from reference_rt.sampling.warp import concentric_disk
from reference_rt.util.errors import SceneError

# ---- shapes --------------------------------------------------------------------------------------

MAPS = {
    "none": [],
    "moved": [{"scale": 0.7}, {"rotate": {"axis": [1, 2, 3], "degrees": 50}}],
    "mirrored": [{"scale": [-1, 1, 1]}, {"rotate": {"axis": [0, 1, 1], "degrees": 20}}],
    "sheared": [{"matrix": [[1, 0.4, 0, 0], [0, 0.7, 0.2, 0], [0.1, 0, 1.3, 0]]}],
    "squeezed": [{"scale": [0.6, 1.1, -0.8]}],
}

SHAPES = {
    "sphere": {"type": "sphere", "center": [0.2, -0.1, 0.3], "radius": 0.8},
    "disk": {"type": "disk"},
    "cylinder": {"type": "cylinder", "radius": 0.5, "z_min": -0.6, "z_max": 0.9},
    "tube": {"type": "cylinder", "radius": 0.5, "z_min": -0.6, "z_max": 0.9, "capped": False},
    "rectangle": {"type": "rectangle"},
    "box": {"type": "box"},
    "triangle": {"type": "triangle", "v0": [-1, -1, 0], "v1": [1, -0.8, 0], "v2": [0.1, 1, 0.3]},
    "mesh": {
        "type": "mesh",
        "vertices": [[-1, -1, 0], [1, -1, 0], [1, 1, 0.5], [-1, 1, 0]],
        "faces": [[0, 1, 2], [0, 2, 3]],
        "normals": [[-0.1, 0, 1], [0, 0.1, 1], [0, 0, 1], [0.1, 0.1, 1]],
        "uv": [[0, 0], [1, 0], [1, 1], [0, 1]],
    },
}

MATERIALS = {
    "plain": {"type": "diffuse"},
    "pattern": {"type": "diffuse", "reflectance": "checker"},
    "lamp": {"type": "emissive", "radiance": 2.0},
    "glowing": {"type": "emissive", "radiance": 2.0, "base": "pattern"},
}
TEXTURES = {"checker": {"type": "checker"}}

TRIANGLES_OFF = 1e-4
"""Triangles for a curved shape of this size are up to 8e-5 off it, as the notes of the file say."""

EXACT = 1e-9
"""Float64's rounding, through transforms of a few units, is far below this."""

COORDINATE_OFF = 2e-3
"""Texture coordinates of a fan of 1,024 triangles, which are linear in each."""


def rays_at(places: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rays from all sides through the unit balls around places: and which one each is for."""
    rng = np.random.default_rng(3)
    which = rng.integers(len(places), size=count)
    out = rng.normal(size=(count, 3))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    aim = places[which] + rng.uniform(-0.6, 0.6, (count, 3))
    o = aim + 2.5 * out
    return o, -out, which


def assert_same_hits(scene: Scene, file, folder, o, d, textured=None) -> None:
    """textured: of rays, whether texture coordinates count."""
    ours, theirs = scene.intersect(o, d), intersect(file, folder, o, d)
    met = np.isfinite(ours.t)
    both = met & np.isfinite(theirs.t)
    assert both.sum() > 0.25 * len(o)
    assert (met != np.isfinite(theirs.t)).mean() < 0.004  # rims of triangles
    off = TRIANGLES_OFF if " as triangles" in (folder / "out.pbrt").read_text() else EXACT
    near = np.zeros(len(o), np.bool_)
    near[both] = np.abs((ours.t[both] - theirs.t[both]) * (ours.n * d).sum(1)[both]) < off
    assert near[both].mean() > 0.995  # the rest meets an edge
    cosine = (ours.n * theirs.n).sum(1)[both]
    assert (cosine > 0.9999).mean() > 0.995
    if textured is not None:
        chosen = near & textured
        assert chosen.sum() > 50
        off = np.abs(ours.uv - theirs.uv)[chosen]
        off = np.minimum(off, np.abs(off - 1.0))  # where u begins again
        assert np.quantile(off.max(axis=1), 0.99) < COORDINATE_OFF


@pytest.mark.cases(max(len(MATERIALS), len(MAPS)))
@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("steps", MAPS)
def test_shapes_are_where_ours_are(steps, material, tmp_path):
    """Places, fronts and, under a texture, coordinates of each shape under each map."""
    names = [n for n in SHAPES if n != "triangle" or material in ("plain", "lamp")]
    places = np.array([[4.0 * k, 0.0, 1.0] for k in range(len(names))])
    shapes = [
        {
            **SHAPES[name],
            "material": material,
            "transform": [*MAPS[steps], {"translate": place.tolist()}],
        }
        for name, place in zip(names, places, strict=True)
    ]
    scene = scene_of(shapes=shapes, materials=MATERIALS, textures=TEXTURES)
    file = written(scene, tmp_path)
    emits = material in ("lamp", "glowing")
    assert all((shape.light is not None) == emits for shape in file.shapes)
    o, d, which = rays_at(places, 400)
    textured = np.full(len(which), material in ("pattern", "glowing"))
    assert_same_hits(scene, file, tmp_path, o, d, textured if textured.any() else None)


@pytest.mark.parametrize(
    ("steps", "name", "material"),
    [
        ("moved", "sphere", "lamp"),
        ("mirrored", "sphere", "lamp"),
        ("mirrored", "disk", "lamp"),
        ("mirrored", "cylinder", "lamp"),
        ("mirrored", "tube", "glowing"),
        ("sheared", "tube", "lamp"),
        ("squeezed", "disk", "lamp"),
    ],
)
def test_lamps_keep_lengths(steps, name, material, tmp_path):
    """pbrt samples a lamp as if its shape's transform kept lengths and orientation."""
    shape = {**SHAPES[name], "material": material, "transform": MAPS[steps]}
    scene = scene_of(shapes=[shape], materials=MATERIALS, textures=TEXTURES)
    for part in written(scene, tmp_path).shapes:
        assert part.light is not None
        a = part.object[:3, :3]
        np.testing.assert_allclose(a.T @ a, np.eye(3), atol=1e-12)
        assert np.linalg.det(a) > 0.0
        assert not part.reversed


def test_instances(tmp_path):
    groups = {
        "pair": [
            {**SHAPES["sphere"], "material": "plain"},
            {**SHAPES["mesh"], "transform": [{"translate": [2.0, 0, 0]}], "material": "plain"},
            {**SHAPES["box"], "transform": [{"translate": [5.0, 0, 0]}], "material": "lamp"},
        ],
        "lit": [{**SHAPES["rectangle"], "material": "lamp"}],
    }
    maps = {"moved": [{"translate": [0, 5, 0]}], "mirrored": [{"scale": [1, -0.5, 1]}]}
    shapes = [{"type": "instance", "group": "pair", "transform": m} for m in maps.values()]
    shapes += [{"type": "instance", "group": "lit", "transform": [{"translate": [9, 1, 0]}]}]
    scene = scene_of(shapes=shapes, groups=groups, materials=MATERIALS, textures=TEXTURES)
    file = written(scene, tmp_path)
    assert (tmp_path / "out.pbrt").read_text().count("ObjectBegin") == 1
    assert sum(shape.light is not None for shape in file.shapes) == 3
    places = np.array([[x, y, 0.0] for y in (0, 5) for x in (0, 2, 5)] + [[9, 1, 0]], float)
    o, d, _ = rays_at(places, 600)
    assert_same_hits(scene, file, tmp_path, o, d)


# ---- cameras ----------------------------------------------------------

LOOK = {"eye": [1.0, 2.0, 5.0], "target": [0.2, 0.4, -1.0], "up": [0.1, 1.0, 0.2]}
VIEW = [-0.7, 0.4, -0.2, 0.5]
CAMERAS = {
    "fov": {"type": "perspective", "fov": 35.0},
    "diagonal": {"type": "perspective", "fov": 35.0, "fov_axis": "diagonal"},
    "view": {"type": "perspective", "view": VIEW, "distance": 2.0},
    "pinhole": {"type": "pinhole", "film_width": 0.8, "film_distance": 1.1},
    "orthographic": {"type": "orthographic", "width": 3.0},
    "oblong": {"type": "orthographic", "view": VIEW},
    "lens": {"type": "thin_lens", "aperture_radius": 0.3, "view": VIEW},
    "focused": {"type": "thin_lens", "aperture_radius": 0.3, "focus_distance": 2.5},
}


@pytest.mark.parametrize("name", CAMERAS)
def test_camera_rays_are_ours(name, tmp_path):
    camera = {**CAMERAS[name], **LOOK}
    scene = scene_of(camera=camera, film={"width": 48, "height": 32})
    file = written(scene, tmp_path)
    points = np.random.default_rng(1).uniform(size=(50, 2))
    lens = (0.9, 0.35) if "lens" in camera["type"] else None
    pixels = points * [48, 32] - 0.5
    spots = None
    if lens:
        a, b = concentric_disk(*lens)
        radius = file.options["Camera"][1]["float lensradius"][0]
        # Our lens's first axis is to the right, as pbrt's x is.
        spots = np.tile([radius * a, radius * b], (50, 1))
    ours = scene.camera_rays(pixels, lens=lens) if lens else scene.camera_rays(pixels)
    theirs = camera_rays(file, points, spots)
    for mine, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(mine, other, atol=1e-13)


@pytest.mark.parametrize(
    "name", ["caustic_glass", "veach_mis", "instances_lit", "camera_thin_lens", "material_blend"]
)
def test_camera_rays_of_scenes_meet_the_same(name, tmp_path):
    scene = Scene.load(SCENES / f"{name}.yaml")
    file = written(scene, tmp_path)
    points = np.random.default_rng(6).uniform(size=(300, 2))
    o, d = camera_rays(file, points)
    assert_same_hits(scene, file, tmp_path, o, d)


@pytest.mark.slow
def test_every_scene_is_written_or_refused(tmp_path):
    """As many as the documentation says."""
    count = 0
    paths = sorted(SCENES.glob("*.yaml"))
    for path in paths:
        try:
            written(Scene.load(path), tmp_path)
            count += 1
        except SceneError as error:
            for reason in (error, *error.others):
                assert reason.path
                assert reason.message.startswith("pbrt-v4 cannot express ")
    text = " ".join((SCENES.parent / "docs" / "scenes.md").read_text().split())
    assert f"{count} of the {len(paths)} scenes of `scenes/` can be written" in text

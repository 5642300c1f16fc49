"""Several sets of texture coordinates: pictures against closed forms, and what is refused."""

import json

import numpy as np
import pytest
from PIL import Image

import reference_rt as rt

SIDE, OFF = 24, 0.013
TEXELS = np.random.default_rng(3).integers(0, 256, (4, 6, 3), dtype=np.uint8)
SQUARE = {
    "type": "mesh",
    "vertices": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
    "faces": [[0, 1, 2], [0, 2, 3]],
    "material": "lamp",
}
AFFINE = np.array([[2.0, 1.0, 0.27], [-1.0, 3.0, 0.53]])
"""Set 2 of (x, y, 1)."""


def sets(x, y):
    """(u, v) of the sets 0, 1 and 2 at points of the square, both triangles of which have one map;
    set 1 has a map of its own on each."""
    ones = np.ones_like(x)
    lower = np.stack([3.0 * y, 2.0 * x])
    upper = np.stack([3.0 * y, 1.0 + 2.0 * x - y])
    return (
        np.stack([x, y]),
        np.where(x > y, lower, upper),
        np.einsum("ij,j...->i...", AFFINE, np.stack([x, y, ones])),
    )


def square(**more):
    """The square by corners, whose set 1 jumps on the diagonal."""
    x, y = np.array(SQUARE["vertices"], float)[np.ravel(SQUARE["faces"]), :2].T
    lower, upper = np.stack([3.0 * y, 2.0 * x]), np.stack([3.0 * y, 1.0 + 2.0 * x - y])
    first = np.where(np.arange(6) < 3, lower, upper)
    second = AFFINE @ np.stack([x, y, np.ones(6)])
    return {
        **SQUARE,
        "vertices": np.stack([x, y, 0.0 * x], axis=1).tolist(),
        "faces": [[0, 1, 2], [3, 4, 5]],
        "uv": np.stack([x, y], axis=1).tolist(),
        "more_uv": np.vstack([first, second]).T.tolist(),
        **more,
    }


def seen(tmp_path, textures, radiance, shapes, integrator=None, **more):
    """The colours of a picture of the unit square, seen a little from the right, without the column
    beyond it: row by row from the top."""
    Image.fromarray(TEXELS).save(tmp_path / "t.png")
    scene = {
        "film": {"width": SIDE, "height": SIDE},
        "integrator": integrator or {"type": "whitted"},
        "sampler": more.pop("sampler", {"type": "grid", "spp": 1}),
        "camera": {
            "type": "orthographic",
            "eye": [OFF + 0.5, 0.5, 5],
            "target": [OFF + 0.5, 0.5, 0],
            "width": 1.0,
        },
        "textures": textures,
        "materials": {
            "dark": {"type": "diffuse", "reflectance": 0.0},
            "lamp": {"type": "emissive", "radiance": radiance, "base": "dark"},
            **more.pop("materials", {}),
        },
        "shapes": shapes,
        **more,
    }
    scene = rt.Scene.parse(json.dumps(scene), folder=tmp_path)
    return np.asarray(rt.render(scene).colour)[:, : SIDE - 1]


def places():
    """x and y of the pixels' middles, none of which is on a diagonal of the square."""
    middles = (np.arange(SIDE) + 0.5) / SIDE
    return np.meshgrid(OFF + middles[:-1], middles[::-1])


def looked(kind, uv):
    """The closed form of each texture."""
    u, v = uv
    if kind == "checker":
        return np.where((u % 1.0 < 0.5) == (v % 1.0 < 0.5), 0.75, 0.25)[..., None] * np.ones(3)
    height, width, _ = TEXELS.shape
    column, line = np.floor(u * width).astype(int), np.floor((1.0 - v) * height).astype(int)
    return TEXELS[line % height, column % width] / 255.0


KINDS = {
    "checker": {"type": "checker", "first": 0.75, "second": 0.25},
    "bitmap": {"type": "bitmap", "file": "t.png", "encoding": "raw", "filter": "nearest"},
}


def products(kinds):
    named = {f"{kind} {k}": {**KINDS[kind], "uv_set": k} for kind in kinds for k in range(3)}
    return named | {"all": {"type": "product", "of": [*named]}}


def test_each_texture_has_its_own_set(tmp_path):
    """On a mesh beside meshes with fewer sets, whose rows the hierarchy mixes."""
    textures = products(KINDS)
    others = [
        {**SQUARE, "material": None, "transform": [{"translate": [k, 0, -1]}]} for k in (-2, 2, 4)
    ]
    shapes = [*others[:2], square(), others[2]]
    found = seen(tmp_path, textures, "all", shapes)
    uv = sets(*places())
    expected = np.prod([looked(kind, uv[k]) for kind in KINDS for k in range(3)], axis=0)
    assert np.allclose(found, expected, rtol=1e-14, atol=0.0)


@pytest.mark.parametrize("way", ["mirrored", "instance", "solid"])
def test_wherever_the_mesh_stands(tmp_path, way):
    """Mirrored triangles keep their front, and so exchange corners."""
    textures, uv = products(["bitmap"]), sets(*places())
    groups = {}
    if way == "mirrored":
        shapes = [square(transform=[{"scale": [1, -1, 1]}, {"translate": [0, 1, 0]}])]
        x, y = places()
        uv = sets(x, 1.0 - y)
    elif way == "instance":
        groups = {"g": [square(transform=[{"scale": 2}])]}
        shapes = [{"type": "instance", "group": "g", "transform": [{"scale": 0.5}]}]
    else:
        corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
        corners += [[x, y, -1] for x, y, _ in corners]
        faces = [[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]]
        for a, b in ((0, 1), (1, 2), (2, 3), (3, 0)):
            faces += [[a, a + 4, b], [b, a + 4, b + 4]]
        pairs = np.array(corners)[:, :2]
        second = np.hstack([pairs, np.ones((8, 1))]) @ AFFINE.T
        solid = {"type": "mesh", "vertices": corners, "faces": faces, "uv": pairs.tolist()}
        solid |= {"more_uv": np.hstack([pairs[:, ::-1], second]).tolist(), "material": "lamp"}
        ball = {"type": "sphere", "center": [0.5, 0.5, -2], "radius": 0.5, "material": "dark"}
        shapes = [{"type": "difference", "of": [solid, ball]}]
        uv = (uv[0], uv[0][::-1], uv[2])
    found = seen(tmp_path, textures, "all", shapes, groups=groups)
    expected = np.prod([looked("bitmap", one) for one in uv], axis=0)
    assert np.allclose(found, expected, rtol=1e-14, atol=0.0)


def test_light_of_a_lamp_by_another_set(tmp_path):
    """A floor sees a lamp of which a half shines, by its set 1, as it sees that half."""
    floor = {"type": "rectangle", "transform": [{"scale": 3}, {"translate": [0.5, 0.5, -1]}]}
    half = square(
        vertices=[[0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0]],
        faces=[[0, 1, 2], [0, 2, 3]],
        uv=[[0, 0]] * 4,
        more_uv=[[0, 0.25], [0, 0.25], [1, 0.25], [1, 0.25]],
    )
    textures = {"t": {"type": "checker", "first": 1, "second": 0, "uv_set": 1}}
    camera = {"type": "orthographic", "eye": [0.5, 0.5, -0.1], "target": [0.5, 0.5, -1], "width": 1}
    more = {"camera": camera, "materials": {"white": {"type": "diffuse", "reflectance": 1.0}}}
    sampler = {"type": "sobol", "spp": 256}
    whole = [floor | {"material": "white"}, half]
    found = seen(tmp_path, textures, "t", whole, {"type": "direct"}, sampler=sampler, **more)
    part = {**half, "vertices": [[0, 0, 0], [0, 1, 0], [0.5, 1, 0], [0.5, 0, 0]]}
    part |= {"more_uv": None, "uv": None}
    alone = [floor | {"material": "white"}, part]
    right = seen(tmp_path, {}, 1.0, alone, {"type": "direct"}, sampler=sampler, **more)
    assert right.mean() > 0.02
    assert np.allclose(found.mean(), right.mean(), rtol=0.01)


# ---- what is refused -----------------------------------------------------------------------------


def refused(tmp_path, **parts):
    textures = {"t": {"type": "checker", "uv_set": 2}}
    textures["p"] = {"type": "product", "of": ["t"]}
    text = json.dumps({"textures": textures, **parts})
    with pytest.raises(rt.SceneError) as error:
        rt.Scene.parse(text, folder=tmp_path).tables  # noqa: B018
    return str(error.value)


LACK = "the texture '{}' of its material has uv_set 2; expected a mesh whose 'more_uv' has 2 sets"


@pytest.mark.parametrize("name", ["t", "p"])
@pytest.mark.parametrize(
    ("shape", "got"),
    [
        ({"type": "sphere"}, 0),
        ({k: v for k, v in SQUARE.items() if k != "material"}, 0),
        ({**SQUARE, "more_uv": [[0, 0], [1, 0], [1, 1], [0, 1]]}, 1),
    ],
)
def test_shapes_without_the_set(tmp_path, name, shape, got):
    materials = {"m": {"type": "diffuse", "reflectance": name}, "n": {"type": "two_sided"}}
    materials["n"] |= {"base": "m"}
    for material in "mn":
        told = refused(tmp_path, materials=materials, shapes=[{**shape, "material": material}])
        assert LACK.format(name) in told
        assert f"got {got}" in told
        assert "shapes[0]" in told
    group = {"g": [{**shape, "material": "m"}]}
    told = refused(tmp_path, materials=materials, groups=group,
                   shapes=[{"type": "instance", "group": "g"}])  # fmt: skip
    assert "groups.g[0]" in told


def test_tilted_normals_and_projectors_have_the_surfaces_own(tmp_path):
    bases = {"d": {"type": "diffuse"}}
    for material in ({"type": "normal_map", "normals": "p"}, {"type": "bump", "height": "t"}):
        told = refused(tmp_path, materials={**bases, "m": {**material, "base": "d"}})
        assert "has another 'uv_set' than 0; expected 0: tilted normals follow" in told
    light = {"type": "projector", "origin": [0, 1, 0], "target": [0, 0, 0], "irradiance": "t"}
    told = refused(tmp_path, lights=[{**light, "up": [1, 0, 0]}])
    assert "an image that a light projects has no mesh" in told


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([[0, 0, 0]] * 4, "expected an (n, 2 k) array"),
        ([[]] * 4, "expected an (n, 2 k) array"),
        ([[0, 0]] * 3, "3 more_uv and 4 vertices; expected one for each"),
        ([[0, 0], [0, 0], [0, 0, 0, 0], [0, 0]], "expected an (n, 2 k) array"),
    ],
)
def test_sets_of_another_size(rows, words):
    with pytest.raises(rt.SceneError) as error:
        rt.Scene.parse(json.dumps({"shapes": [{**SQUARE, "material": None, "more_uv": rows}]}))
    assert words in str(error.value)
    assert "more_uv" in str(error.value)


def test_sets_that_no_texture_has_leave_kernels_alone(tmp_path):
    """The tables are of the same type as without them."""
    Image.fromarray(TEXELS).save(tmp_path / "t.png")
    parts = {
        "textures": {"t": KINDS["bitmap"]},
        "materials": {"lamp": {"type": "diffuse", "reflectance": "t"}},
    }
    scene = rt.Scene.parse(json.dumps({**parts, "shapes": [square()]}), folder=tmp_path)
    assert not scene.tables.textures.sets.number.any()
    assert scene.tables.geometry.shapes.triangles.more_uvs is None

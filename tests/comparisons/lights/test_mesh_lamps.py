"""Lamps of Mitsuba's own files that are meshes: where Mitsuba's emitter is not exact, ours takes
its place, with the file's own parameters."""

import math

import numpy as np
import pytest
from mesh_writers import packed
from mitsuba_dicts import theirs_along
from PIL import Image

from comparisons.mitsuba.backend import backend, mitsuba
from comparisons.translator.reading import read_file
from comparisons.translator.reference import changes_to, own_scene
from reference_rt.rendering.scene import Scene

FAST = pytest.mark.skipif(
    backend().variant.startswith("scalar"), reason="needs a fast variant of Mitsuba"
)

FLOOR = """<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="2"/>
</integrator><sensor type="perspective"/>
<shape type="rectangle"><transform name="to_world"><scale value="5"/><rotate x="1" angle="-90"/>
</transform><bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>
</bsdf></shape>
<shape type="rectangle"><transform name="to_world"><scale value="5"/><rotate x="1" angle="90"/>
<translate y="4"/></transform><bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>
</shape>{}</scene>"""
"""A floor at y = 0 and a ceiling at y = 4: what shines upwards is seen, too."""

AREA = '<emitter type="area">{}</emitter>'
WHITE = AREA.format('<rgb name="radiance" value="5"/>')
PICTURE = AREA.format(
    '<texture type="bitmap" name="radiance"><string name="filename" value="lamp.png"/></texture>'
)
FLAT = '<boolean name="face_normals" value="true"/>'
TURNED = '<boolean name="flip_normals" value="true"/>'
MIRRORED = '<transform name="to_world"><scale z="-1"/></transform>'

CORNERS = np.array([[-1.0, 2, -1], [1, 2, -1], [1, 2, 1], [-1, 2.4, 1]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])
"""Wound so that the front is below; a little bent, so that Mitsuba makes normals that tilt."""

TILTED = np.array([[0.8, -0.6, 0], [-0.8, -0.6, 0], [-0.8, -0.6, 0], [0.8, -0.6, 0]])


def obj(normals=None):
    lines = ["v {} {} {}".format(*p) for p in CORNERS]
    lines += ["vt {} {}".format(*p) for p in ((0, 0), (1, 0), (1, 1), (0, 1))]
    lines += [] if normals is None else ["vn {} {} {}".format(*n) for n in normals]
    for face in FACES + 1:
        names = [f"{k}/{k}" if normals is None else f"{k}/{k}/{k}" for k in face]
        lines.append("f " + " ".join(names))
    return "\n".join(lines).encode()


def ply(normals):
    names = ["x", "y", "z", "nx", "ny", "nz"][: 3 if normals is None else 6]
    rows = CORNERS if normals is None else np.hstack([CORNERS, normals])
    head = ["ply", "format ascii 1.0", "element vertex 4", *(f"property float {n}" for n in names)]
    head += ["element face 2", "property list uchar int vertex_index", "end_header"]
    body = [" ".join(map(str, row)) for row in rows] + ["3 0 1 2", "3 0 2 3"]
    return "\n".join([*head, *body, ""]).encode()


def serialized(normals):
    return packed(4, (CORNERS, FACES, normals, False))


LAMPS = {
    "obj, normals": ("obj", obj(TILTED), WHITE),
    "obj, normals against the winding": ("obj", obj(-TILTED), WHITE),
    "obj, normals of Mitsuba": ("obj", obj(), WHITE),
    "obj, turned": ("obj", obj(TILTED), TURNED + WHITE),
    "obj, turned, no normals": ("obj", obj(), TURNED + WHITE),
    "obj, mirrored": ("obj", obj(TILTED), MIRRORED + WHITE),
    "obj, a picture": ("obj", obj(), FLAT + PICTURE),
    "obj, a picture and normals": ("obj", obj(TILTED), PICTURE),
    "obj, turned, a picture": ("obj", obj(), TURNED + FLAT + PICTURE),
    "obj, no radiance": ("obj", obj(TILTED), AREA.format("")),
    "ply, normals": ("ply", ply(TILTED), WHITE),
    "ply, normals of Mitsuba": ("ply", ply(None), WHITE),
    "serialized, normals": ("serialized", serialized(TILTED), WHITE),
    "serialized, a picture": ("serialized", serialized(None), PICTURE),
}
"""The kind of file, what is in it, and the children of the shape."""


def scene_of(folder, kind, content, parts):
    pixels = np.random.default_rng(1).integers(0, 255, (4, 4, 3), dtype=np.uint8)
    Image.fromarray(pixels).save(folder / "lamp.png")
    (folder / f"lamp.{kind}").write_bytes(content)
    name = f'<string name="filename" value="lamp.{kind}"/>'
    text = FLOOR.format(f'<shape type="{kind}">{name}{parts}</shape>')
    (folder / "own.xml").write_text(text)
    return read_file(folder / "own.xml", Scene)


RAYS, SAMPLES = 48, 2048


def deviation(scene, theirs):
    """How far our mean radiance of floor or ceiling is from Mitsuba's, in its noise, where it is
    furthest, of three channels; and the relative difference there."""
    found = []
    rng = np.random.default_rng(2)
    for height in (0.0, 4.0):
        x, z = rng.uniform(-2, 2, (2, RAYS))
        o = np.tile([0.0, 1.0 if height else 1.5, 4.8], (RAYS, 1))
        d = np.column_stack([x, np.full(RAYS, height), z]) - o
        d /= np.linalg.norm(d, axis=1)[:, None]
        ours = scene.radiance(o, d, spp=SAMPLES)
        mean, error = theirs_along(theirs, o, d, SAMPLES)
        off, mean = np.abs(ours.mean.mean(axis=0) - mean.mean(axis=0)), mean.mean(axis=0)
        noise = np.sqrt((ours.standard_error**2 + error**2).sum(axis=0)) / RAYS
        sigmas = off / np.maximum(noise, 1e-4 * mean + 1e-12)  # float32
        found += list(zip(sigmas.tolist(), (off / np.maximum(mean, 1e-9)).tolist(), strict=True))
    return max(found)


@pytest.mark.cases(4)
@FAST
@pytest.mark.parametrize("name", LAMPS)
def test_the_exact_emitter_stands_in(name, tmp_path):
    scene = scene_of(tmp_path, *LAMPS[name])
    assert [note for note in changes_to(scene) if "emitter of ours" in note]
    sigmas, off = deviation(scene, own_scene(scene))
    # Of two surfaces, three channels and 14 lamps.
    assert sigmas < 5.0, off


@pytest.mark.slow
@FAST
@pytest.mark.parametrize("name", ["obj, normals", "ply, normals", "serialized, normals"])
def test_mitsubas_own_differs(name, tmp_path):
    scene = scene_of(tmp_path, *LAMPS[name])
    sigmas, off = deviation(scene, mitsuba().load_file(str(tmp_path / "own.xml")))
    assert sigmas > 6.0
    assert off > 0.05


@FAST
def test_files_that_name_our_emitter(tmp_path):
    """As `convert` writes them: Mitsuba renders them, with the plugin registered."""
    scene = scene_of(tmp_path, "ply", ply(TILTED), WHITE)
    text = (tmp_path / "own.xml").read_text().replace('"area"', '"mesh_area"')
    (tmp_path / "ours.xml").write_text(text)
    sigmas, off = deviation(scene, mitsuba().load_file(str(tmp_path / "ours.xml")))
    assert sigmas < 5.0, off


@FAST
def test_what_mitsuba_has_right_stays(tmp_path):
    scene = scene_of(tmp_path, "obj", obj(TILTED), FLAT + WHITE)
    assert changes_to(scene) == []
    assert "MeshArea" not in str(own_scene(scene))


BELOW = """
materials:
  lamp: {{type: emissive, radiance: 5}}
  grey: {{type: diffuse, reflectance: 0.5}}
shapes:
  - {{type: mesh, vertices: {}, faces: {}, normals: {}, material: lamp}}
  - type: rectangle
    material: grey
    transform: [{{scale: 5}}, {{rotate: {{axis: [1, 0, 0], degrees: -90}}}}]
"""


def test_ours_is_the_integral():
    """The irradiance below a lamp with tilted vertex normals is that of its triangles, by
    quadrature."""
    lamp = np.array([[-1.0, 2, -1], [1, 2, -1], [1, 2, 1], [-1, 2, 1]])
    scene = Scene.parse(BELOW.format(lamp.tolist(), FACES.tolist(), TILTED.tolist()))
    x, w = np.polynomial.legendre.leggauss(32)
    gx, gz = np.meshgrid(x, x)
    d2 = (gx - 1.5) ** 2 + 4.0 + gz**2
    form = float((np.outer(w, w) * 4.0 / d2**2).sum()) / math.pi
    o = np.tile([1.5, 1.0, 0.0], (64, 1))
    found = scene.radiance(o, np.tile([0.0, -1.0, 0.0], (64, 1)), spp=4096)
    mean, error = found.mean[:, 0].mean(), np.sqrt((found.standard_error[:, 0] ** 2).sum()) / 64
    assert abs(mean - 0.5 * 5.0 * form) < 4.0 * error
    assert error < 1e-3 * mean

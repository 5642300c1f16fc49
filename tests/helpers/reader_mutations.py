"""Damaged files for every reader of meshes, images and scenes: `python reader_mutations.py SEED
COUNT` prints, as JSON, what came of so many of them.

Each case is a sound file with one to four damages: of its bytes, and where a format is a container
also of the text, the numbers or the data within it.  It runs in a process of its own, with limited
memory, so that whatever is worse than an error is seen by who started it."""

import io
import json
import resource
import signal
import struct
import sys
import tempfile
import time
import traceback
import warnings
import zipfile
from pathlib import Path

import numpy as np

from comparisons.experiments.fuzz.assets import files as assets
from comparisons.experiments.stability.hostile.damage import damaged, with_structure

SECONDS = 20
"""Of computing, after which a case hangs: each takes milliseconds."""

MEMORY = 4 << 30
"""Bytes of address space: more than 100 times what the largest sound file takes."""


def sound(folder):
    """Sound files by name, and the ways to damage each."""
    import OpenEXR
    from exr_writer import exr
    from gltf_compressed import by_draco, by_meshopt, plain, written_meshopt
    from gltf_scenes import full_scene
    from mesh_writers import FACES, FORMS, SQUARE, XYZ, V, model_3mf, ply
    from PIL import Image

    found = {name: content for name, content in assets().items() if name != "copies.npy"}
    full = V + "vt 0 1\nvn 0 0 1\nf 1/1/1 2/1/1 \\\n-2/1/1\nf 1/1/1 2/1/1 3/1/1 4/1/1\n"
    found["full.obj"] = full.encode()
    found["large.obj"] = found["ball.obj"] + found["ball.obj"].replace(b"f ", b"# ") * 200
    found["text.stl"] = (
        b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
        b"endloop\nendfacet\nendsolid a\n"
    )
    wedges = [[[0, 1, 2], [0, 0, 1, 0, 1, 1]], [[0, 1, 2, 3], [0, 0, 0.5, 0.2, 1, 1, 0, 1]]]
    vertices = ("vertex", XYZ, SQUARE.tolist())
    for form in FORMS:
        faces = ("face", [*FACES, "list uchar float texcoord"], wedges)
        found[f"{form}.ply"] = ply(form, vertices, faces)
        strips = ("tristrips", ["list int int vertex_indices"], [[[0, 1, 2, 3, -1, 0, 1, 2]]])
        found[f"{form}_strips.ply"] = ply(form, vertices, strips)
    archive = model_3mf(folder, SQUARE.tolist(), [[0, 1, 2], [0, 2, 3]])
    found["archive.3mf"] = found["text.3mf"] = archive.read_bytes()
    found["scene.glb"], found["scene.gltf"] = full_scene().glb(), full_scene().gltf()
    found["plain.gltf"] = plain().gltf()
    found["two_sets.glb"] = two_sets().glb()
    for k, how in enumerate(({"preserve_order": True}, {"compression_level": 10}, {})):
        found[f"draco{k}.glb"] = by_draco(**how).glb()
    for k, name in enumerate(("EXT_meshopt_compression", "KHR_meshopt_compression")):
        path = written_meshopt(folder, by_meshopt(name, ("TRIANGLES", "INDICES")[k]))
        found[f"meshopt{k}.gltf"] = path.read_bytes()
        found[f"meshopt{k}.bin"] = (folder / "packed.bin").read_bytes()
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 256, (6, 8, 3)).astype(np.uint8)
    kinds = {"webp": "WEBP", "bmp": "BMP", "tga": "TGA", "ppm": "PPM", "gif": "GIF"}
    for suffix, kind in kinds.items():
        stream = io.BytesIO()
        Image.fromarray(pixels).save(stream, kind)
        found[f"image.{suffix}"] = stream.getvalue()
    found["old.hdr"] = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n" + bytes(range(100, 132))
    half = {"RY": np.full((3, 4), 0.1, "<f4"), "BY": np.full((3, 4), 0.2, "<f4")}
    found["chroma.exr"] = exr({"Y": np.ones((6, 8), "<f4"), **half}, {"RY": 2, "BY": 2})
    whole = {name: np.full((6, 8), 0.5, "<f2") for name in ("a.R", "a.G", "a.B", "a.A")}
    found["half.exr"] = exr(whole)
    deep = {name: np.empty((6, 8), object) for name in "RGB"}
    for at in np.ndindex(6, 8):
        for name in "RGB":
            deep[name][at] = rng.uniform(size=sum(at) % 3).astype(np.float32)
    for compression in ("NO", "RLE", "ZIPS"):
        kind = getattr(OpenEXR, f"{compression}_COMPRESSION")
        path = folder / "deep.exr"
        OpenEXR.File({"type": OpenEXR.deepscanline, "compression": kind}, deep).write(str(path))
        found[f"deep_{compression}.exr"] = path.read_bytes()
    scene = {"shapes": [{"type": "mesh", "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
                         "faces": [[0, 1, 2]]}]}  # fmt: skip
    found["scene.yaml"] = found["scene.json"] = json.dumps(scene).encode()
    return found


def two_sets():
    """A scene whose material has textures by two sets of texture coordinates."""
    from gltf_scenes import UV, GltfScene

    file = GltfScene(emissiveFactor=[1, 1, 1])
    texture = file.texture()
    file.primitive["attributes"]["TEXCOORD_1"] = file.add((2.0 * UV[:, ::-1]).astype(np.float32))
    file.material["pbrMetallicRoughness"] = {"baseColorTexture": {"index": texture}}
    file.material["emissiveTexture"] = {"index": texture, "texCoord": 1}
    return file


IMAGES = (".png", ".exr", ".hdr", ".pfm", ".npy", ".tif", ".jpg", ".webp", ".bmp", ".tga", ".ppm")
IMAGES += (".gif",)


def damage(rng, name, content):
    count = int(rng.choice([1, 1, 1, 2, 4]))
    if name == "text.3mf":
        return rezipped(rng, content, count)
    if name.endswith(".gltf") and rng.random() < 0.6:
        return json.dumps(with_structure(rng, json.loads(content), count)).encode(
            "utf-8", "replace"
        )
    if name.endswith(".glb") and rng.random() < 0.6:
        return rebuilt(rng, content, count)
    return damaged(rng, content, count)


def rezipped(rng, content, count):
    """An archive whose texts are damaged, and each packed again."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(out, "w", 8) as new:
        for entry in old.infolist():
            text = old.read(entry)
            if entry.filename.endswith("model") or rng.random() < 0.2:
                text = damaged(rng, text, count)
            new.writestr(entry.filename, text)
    return out.getvalue()


def rebuilt(rng, content, count):
    """A .glb whose JSON or data are damaged, under right lengths."""
    (size,) = struct.unpack_from("<I", content, 12)
    text, data = content[20 : 20 + size], content[28 + size :]
    if rng.random() < 0.5:
        data = damaged(rng, data, count)
    else:
        text = json.dumps(with_structure(rng, json.loads(text), count)).encode("utf-8", "replace")
    chunks = b"".join(
        struct.pack("<II", len(part), kind) + part
        for part, kind in ((text, 0x4E4F534A), (data, 0x004E4942))
    )
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def read(path):
    """By the reader of its suffix, and as a scene where it is one.  Returns how often it was
    read."""
    from mesh_writers import check

    import reference_rt as rt
    from reference_rt.shapes.meshes.files import read_mesh
    from reference_rt.textures.image_file import read_image, read_texels

    suffix, found = path.suffix, 0
    ways = [read_mesh]
    if suffix in IMAGES:
        ways = [lambda p: read_image(p, "auto"), lambda p: read_texels(p, "auto", 1.0)]
    elif suffix in (".yaml", ".json"):
        ways = [rt.Scene.load]
    elif suffix in (".gltf", ".glb"):
        ways.append(lambda p: rt.Scene.load(p, allow_missing=True))
    for way in ways:
        try:
            made = way(path)
        except (ValueError, rt.SceneError) as error:
            lines = str(error).splitlines()
            if len(lines) != 1 or str(path) not in lines[0]:
                raise AssertionError(f"not one line that names the file: {str(error)!r}") from None
        else:
            found += 1
            if way is read_mesh:
                check(made)
            elif suffix in IMAGES and not hasattr(made, "data"):
                assert np.isfinite(made).all()
    return found


def main(seed, count):
    warnings.simplefilter("ignore")
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    result = {"cases": 0, "read": 0, "slowest": 0.0, "wrong": [], "by": {}}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        files = sound(folder)
        for name, content in files.items():
            (folder / name).write_bytes(content)
        names = sorted(files)
        for name in names:  # compiles and imports what is needed
            if not name.endswith(".bin"):
                (folder / "packed.bin").write_bytes(files.get(name.replace(".gltf", ".bin"), b""))
                assert read(folder / name) > 0, name
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        rng = np.random.default_rng(seed)
        for k in range(count):
            name = names[k % len(names)]
            content = damage(rng, name, files[name])
            path = folder / f"case_{name}"
            if name.endswith(".bin"):
                (folder / "packed.bin").write_bytes(content)
                path = folder / name.replace(".bin", ".gltf")
            else:
                (folder / "packed.bin").write_bytes(files.get(name.replace(".gltf", ".bin"), b""))
                path.write_bytes(content)
            print(k, name, file=sys.stderr, flush=True)  # the last one, should the process end
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            before = time.process_time()
            try:
                found = read(path)
            except Exception:
                found = 0
                text = traceback.format_exc(limit=-3)
                result["wrong"].append({"case": k, "name": name, "text": text[-1500:]})
                keep = Path(tempfile.gettempdir()) / f"mutation_{seed}_{k}_{name}"
                keep.write_bytes(content)
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            took = time.process_time() - before
            result["slowest"] = max(result["slowest"], took)
            result["cases"] += 1
            result["read"] += found > 0
            one = result["by"].setdefault(name, [0, 0, 0.0])
            one[0], one[1], one[2] = one[0] + 1, one[1] + (found > 0), max(one[2], took)
    result["memory"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10
    print(json.dumps(result))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))

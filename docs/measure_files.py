"""Measures what survives when one program writes an image or a mesh and another reads it:
`python docs/measure_files.py [--markdown FILE]`.

It needs this project, and whichever of these are there: mitsuba, OpenImageIO, opencv-python-
headless, imageio, tifffile, bpy; trimesh, meshio, open3d, lib3mf, usd-core, assimp-py.  Others are
left out of the tables.  Each program runs in a process of its own, since some exclude others.

Images are 7 x 5 pixels, all of them different, so that a turn, a mirror, a shift, another order of
channels and multiplied alpha are told apart.  A cell is what is different from what was written:
the greatest relative error and, where it is not 0, its mean with its sign.
"""

import argparse
import importlib.util
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from mesh_programs import (
    MESH_FORMATS,
    MESH_PROGRAMS,
    WITH_UV,
    scalar_mitsuba,
    told_of_mesh,
)

Array = npt.NDArray[Any]

os.environ["OPENCV_IO_ENABLE_OPENEXR"] = "1"

# ---- images --------------------------------------------------------------------------------------

WIDTH, HEIGHT = 7, 5


def picture(alpha: bool = False) -> Array:
    """(5, 7, 3 or 4), float32, from 1e-3 to 12; alpha from 0.25 to 1."""
    rng = np.random.default_rng(1)
    values = np.exp(rng.uniform(np.log(1e-3), np.log(12.0), (HEIGHT, WIDTH, 4))).astype(np.float32)
    values[..., 3] = np.linspace(0.25, 1.0, WIDTH * HEIGHT).reshape(HEIGHT, WIDTH)
    return values if alpha else values[..., :3]


def codes() -> Array:
    """(5, 7, 3) of uint16, with all sizes of codes."""
    return np.random.default_rng(2).integers(1, 65536, (HEIGHT, WIDTH, 3)).astype(np.uint16)


def mitsuba_write(values: Array, path: Path) -> None:
    mi = scalar_mitsuba()
    pixels = {3: mi.Bitmap.PixelFormat.RGB, 4: mi.Bitmap.PixelFormat.RGBA}[values.shape[2]]
    bitmap = mi.Bitmap(values, pixels)
    if values.dtype == np.uint16:
        bitmap.set_srgb_gamma(True)
    bitmap.write(str(path))


def mitsuba_read(path: Path) -> Array:
    return np.array(scalar_mitsuba().Bitmap(str(path)))


def oiio_write(values: Array, path: Path) -> None:
    import OpenImageIO

    height, width, channels = values.shape
    kind = "uint16" if values.dtype == np.uint16 else "float"
    spec = OpenImageIO.ImageSpec(width, height, channels, kind)
    out = OpenImageIO.ImageOutput.create(str(path))
    if out is None or not out.open(str(path), spec) or not out.write_image(values):
        raise OSError(out.geterror() if out else OpenImageIO.geterror())
    out.close()


def oiio_write_part(values: Array, path: Path) -> None:
    """As the part of a picture of 11 x 8 pixels that begins at (2, 1): the data window lies within
    the display window."""
    import OpenImageIO

    height, width, channels = values.shape
    spec = OpenImageIO.ImageSpec(width, height, channels, "float")
    spec.x, spec.y, spec.full_width, spec.full_height = 2, 1, 11, 8
    out = OpenImageIO.ImageOutput.create(str(path))
    if not out.open(str(path), spec) or not out.write_image(values):
        raise OSError(out.geterror())
    out.close()


def oiio_read(path: Path) -> Array:
    import OpenImageIO

    file = OpenImageIO.ImageInput.open(str(path))
    if file is None:
        raise OSError(OpenImageIO.geterror())
    return np.asarray(file.read_image("uint16" if path.suffix == ".png" else "float"))


def opencv_write(values: Array, path: Path) -> None:
    import cv2

    order = [2, 1, 0, 3][: values.shape[2]]  # as its documentation says
    if not cv2.imwrite(str(path), np.ascontiguousarray(values[..., order])):
        raise OSError("refused")


def opencv_read(path: Path) -> Array:
    import cv2

    found = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if found is None:
        raise OSError("refused")
    return np.asarray(found)[..., [2, 1, 0, 3][: found.shape[2]]]


def imageio_write(values: Array, path: Path) -> None:
    import imageio.v3 as imageio

    imageio.imwrite(path, values)


def imageio_read(path: Path) -> Array:
    import imageio.v3 as imageio

    return np.asarray(imageio.imread(path))


def tifffile_write(values: Array, path: Path) -> None:
    import tifffile

    tifffile.imwrite(path, values, photometric="rgb")


def tifffile_read(path: Path) -> Array:
    import tifffile

    return np.asarray(tifffile.imread(path))


def blender_write(values: Array, path: Path) -> None:
    import bpy

    height, width = values.shape[:2]
    kind = {".exr": "OPEN_EXR", ".hdr": "HDR", ".png": "PNG", ".tif": "TIFF"}[path.suffix]
    image = bpy.data.images.new("picture", width, height, alpha=True, float_buffer=True)
    full = np.ones((height, width, 4), np.float32)
    full[..., : values.shape[2]] = values / (65535.0 if values.dtype == np.uint16 else 1.0)
    image.pixels.foreach_set(full[::-1].ravel())
    scene = bpy.context.scene
    scene.view_settings.view_transform, scene.sequencer_colorspace_settings.name = (
        "Raw",
        "Linear Rec.709",
    )
    settings = scene.render.image_settings
    settings.file_format = kind
    settings.color_mode = "RGBA" if values.shape[2] == 4 else "RGB"
    settings.color_depth = "16" if values.dtype == np.uint16 else "32"
    image.save_render(str(path), scene=scene)


def blender_read(path: Path) -> Array:
    import bpy

    image = bpy.data.images.load(str(path))
    if path.suffix in (".png", ".tif"):
        image.colorspace_settings.name = "Non-Color"
    found = np.array(image.pixels[:], np.float32)
    width, height = image.size
    shown = found.reshape(height, width, 4)[::-1]
    return shown * 65535.0 if path.suffix == ".png" else shown


def ours_write(values: Array, path: Path) -> None:
    from reference_rt.core.exr import write_exr

    write_exr(
        path,
        {name: values[..., k].astype(float) for k, name in enumerate("RGBA"[: values.shape[2]])},
        {},
    )


def ours_read(path: Path) -> Array:
    from reference_rt import read_image

    found = read_image(path)
    if path.suffix == ".png":  # it decodes them from sRGB
        low = found * 12.92
        found = np.where(found <= 0.0031308, low, 1.055 * found ** (1 / 2.4) - 0.055) * 65535.0
    return found


PROGRAMS: dict[str, tuple[str, Callable[[Array, Path], None] | None, Callable[[Path], Array]]] = {
    "ours": ("reference_rt", ours_write, ours_read),
    "Mitsuba": ("mitsuba", mitsuba_write, mitsuba_read),
    "OpenImageIO": ("OpenImageIO", oiio_write, oiio_read),
    "OpenCV": ("cv2", opencv_write, opencv_read),
    "Blender": ("bpy", blender_write, blender_read),
    "imageio": ("imageio", imageio_write, imageio_read),
    "tifffile": ("tifffile", tifffile_write, tifffile_read),
}
"""By name: its module, how it writes and how it reads."""

FORMATS = {
    "exr": (".exr", lambda: picture()),
    "exr with alpha": (".exr", lambda: picture(alpha=True)),
    "exr of a part of a picture": (".exr", lambda: picture()),
    "hdr": (".hdr", lambda: picture()),
    "pfm": (".pfm", lambda: picture()),
    "png of 16 bits": (".png", codes),
    "tif of floats": (".tif", lambda: picture()),
}


def told(written: Array, read: Array) -> str:
    """What is different, in a few words."""
    written, read = written.astype(float), np.asarray(read, float)
    if read.ndim != 3 or read.shape[:2] != written.shape[:2]:
        return f"{' x '.join(map(str, read.shape))} values"
    notes = []
    if read.shape[2] < written.shape[2]:
        notes.append("alpha lost")
    colours = read[..., :3]
    candidates = {
        "": written[..., :3],
        "rows turned": written[::-1, :, :3],
        "columns turned": written[:, ::-1, :3],
        "BGR": written[..., 2::-1],
    }
    if written.shape[2] == 4:
        alpha = written[..., 3:]
        candidates["times alpha"] = written[..., :3] * alpha
        candidates["divided by alpha"] = written[..., :3] / alpha
    # Of the pixel's largest colour, whose exponent all colours of .hdr have.
    size = {name: other.max(axis=2, keepdims=True) for name, other in candidates.items()}
    errors = {
        name: float((np.abs(colours - other) / size[name]).max())
        for name, other in candidates.items()
    }
    name = min(errors, key=errors.__getitem__)
    if errors[name] > 0.2 * max(errors[""], 1e-30):
        name = ""
    if name:
        notes.append(name)
    if written.shape[2] == read.shape[2] == 4 and not np.allclose(
        written[..., 3], read[..., 3], 1e-6
    ):
        notes.append("another alpha")
    off = (colours - candidates[name]) / size[name]
    if errors[name] == 0.0:
        notes.append("exact")
    elif errors[name] < 1.5e-7:
        notes.append("float32")
    else:
        notes.append(f"{errors[name]:.2g}, mean {off.mean():+.1g}")
    return ", ".join(notes)


# ---- the tables ----------------------------------------------------------------------------------


def run_one(kind: str, what: str, name: str, path: Path) -> str:
    """In a process of its own: write, or read and tell."""
    done = subprocess.run(
        [sys.executable, __file__, "--one", kind, what, name, str(path)],
        capture_output=True,
        text=True,
        timeout=300,
    )
    said = done.stdout.rpartition("told: ")[2].strip()  # Mitsuba's log precedes it, in colour
    return said or "no: ended"


def one(kind: str, what: str, name: str, path: Path) -> str:
    try:
        if kind in FORMATS:
            _, write, read = PROGRAMS[name]
            written = FORMATS[kind][1]()
            if what == "read":
                return told(written, read(path))
            assert write is not None
            (oiio_write_part if "part" in kind else write)(written, path)
        else:
            _, write_mesh, read_mesh = MESH_PROGRAMS[name]
            if what == "read":
                return told_of_mesh(read_mesh(path))
            assert write_mesh is not None
            write_mesh(path)
    except BaseException as error:
        print(kind, name, type(error).__name__, " ".join(str(error).split())[:200], file=sys.stderr)
        return f"no: {type(error).__name__}"
    return "written" if path.exists() and path.stat().st_size else "no: nothing was written"


_ONLY = {
    "tifffile": (".tif",),
    "lib3mf": (".stl", ".3mf"),
    "usd-core": (".usda",),
    "Blender": (*(s for s, _ in FORMATS.values()), ".glb", ".usda"),
    "Mitsuba": (*(s for s, _ in FORMATS.values()), ".ply", ".obj"),
}
"""Formats of programs that know few of them."""


def table(kind: str, suffix: str, programs: dict[str, Any]) -> list[str]:
    """Rows of writers, columns of readers."""
    there = [
        name
        for name, (module, *_) in programs.items()
        if importlib.util.find_spec(module) and suffix in _ONLY.get(name, (suffix,))
    ]
    lines = [
        f"### {kind}",
        "",
        f"| written by | {' | '.join(there)} |",
        "|---" * (len(there) + 1) + "|",
    ]
    with tempfile.TemporaryDirectory() as folder:
        for writer in there:
            if programs[writer][1] is None or (writer == "ours" and suffix != ".exr"):
                continue
            if "part" in kind and writer != "OpenImageIO":
                continue
            path = Path(folder) / f"{writer}{WITH_UV if 'texture' in kind else ''}{suffix}"
            said = run_one(kind, "write", writer, path)
            print(kind, writer, said, file=sys.stderr, flush=True)
            if said != "written":
                lines.append(f"| {writer} | {said} |" + " |" * (len(there) - 1))
                continue
            cells = [run_one(kind, "read", reader, path) for reader in there]
            lines.append(f"| {writer} | {' | '.join(cells)} |")
    return [*lines, ""]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--markdown", type=Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--one", nargs=4)
    given = parser.parse_args()
    if given.one:
        kind, what, name, path = given.one
        print("told:", one(kind, what, name, Path(path)), flush=True)
        os._exit(0)  # some crash as they end
    lines: list[str] = []
    for kind, (suffix, _) in FORMATS.items():
        if given.only in kind:
            lines += table(kind, suffix, PROGRAMS)
    for kind, suffix in MESH_FORMATS.items():
        if given.only in kind:
            lines += table(kind, suffix, MESH_PROGRAMS)
    text = "\n".join(lines)
    print(text)
    if given.markdown:
        given.markdown.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()

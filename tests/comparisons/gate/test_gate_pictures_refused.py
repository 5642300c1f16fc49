"""Files and arrays that are no candidate pictures are refused, each with its message."""

import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from picture_writers import chunk, exr, hdr, npy, pfm, png, rgbe

from comparisons.gate.pictures_in import MOST_NUMBERS, from_array, read_candidate
from reference_rt.util.errors import ImageError

_HDR = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 20 +X 30\n"

BAD = {
    "empty": (b"", "is empty; expected an image"),
    "text": (b"an image, honestly", "is not an image that can be read; expected EXR, PNG, PFM"),
    "jpeg": (b"\xff\xd8\xff\xe0\0\x10JFIF\0\1", "is not an image that can be read"),
    "pfm header": (b"PF\nwide high\n-1\n", "malformed PFM header; expected PF, width, height"),
    "pfm without end": (b"PF\n3 2\n-1.0", "malformed PFM header"),
    "pfm of no pixels": (b"PF\n0 2\n-1\n", "has 0 x 2 pixels; expected at least one"),
    "pfm scale": (b"PF\n1 1\n-2\n" + bytes(12), "has the scale -2, which readers do not agree"),
    "pfm scale nan": (b"PF\n1 1\n1e\n" + bytes(12), "has the scale 1e"),
    "pfm truncated": (
        b"PF\n3 2\n-1\n" + bytes(71),
        "is truncated: 71 bytes of pixels; expected 72",
    ),
    "pfm too long": (b"PF\n3 2\n-1\n" + bytes(73), "has 73 bytes of pixels; expected 72"),
    "pfm bomb": (
        b"PF\n300000 200000\n-1\n",
        "is truncated: 0 bytes of pixels; expected 720000000000",
    ),
    "npy truncated": (npy(np.ones((4, 4, 3)))[:-1], "cannot be read as NPY"),
    "npy header": (b"\x93NUMPY\1\0", "cannot be read as NPY"),
    "npy objects": (
        npy(np.array([{}])),
        "cannot be read as NPY: Array can't be memory-mapped: Python objects",
    ),
    "npy bytes": (npy(np.ones((4, 4, 3), np.uint8)), "holds uint8; expected floats"),
    "npy complex": (npy(np.ones((4, 4, 3), complex)), "holds complex128; expected floats"),
    "npy flat": (npy(np.ones((4, 4))), r"has the shape \(4, 4\); expected \(height, width, 3\)"),
    "npy 2 channels": (npy(np.ones((4, 4, 2))), r"has the shape \(4, 4, 2\); expected"),
    "npy of no pixels": (npy(np.ones((0, 4, 3))), "has 4 x 0 pixels; expected at least one"),
    "hdr header": (b"#?RADIANCE\n", "malformed HDR header; expected its lines and -Y height"),
    "hdr axes": (_HDR.replace(b"-Y 20 +X 30", b"+X 20 -X 30"), "malformed HDR header"),
    "hdr xyze": (_HDR.replace(b"rgbe", b"xyze") + bytes(2400), "format '32-bit_rle_xyze'; exp"),
    "hdr exposure": (b"#?\nEXPOSURE=0\n" + _HDR[11:] + bytes(2400), "'EXPOSURE=0'; expected posi"),
    "hdr truncated": (_HDR + bytes(2399), "is truncated: 2399 bytes of pixels; expected 2400"),
    "hdr too long": (_HDR + bytes(2401), "has 2401 bytes of pixels; expected 2400"),
    "hdr short": (_HDR + b"\2\2\0\x1e", "is truncated: too short for its size"),
    "hdr runs": (_HDR + b"\2\2\0\x1e\xff\7" + bytes(400), "is malformed at row 0; expected runs"),
    "hdr row": (_HDR + b"\2\2\0\x1f" + bytes(400), "is malformed at row 0; expected a scanline"),
    "hdr old runs": (_HDR + b"\1" * 2400, "is malformed: expected runs of the old kind after"),
    "hdr bomb": (_HDR.replace(b"30", b"99999999"), "declares 99999999 x 20 pixels of 3 channels"),
    "png header": (b"\x89PNG\r\n\x1a\n1234", "cannot be read as PNG: no header"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files(tmp_path: Path, name: str) -> None:
    content, message = BAD[name]
    path = tmp_path / "a.dat"
    path.write_bytes(content)
    with pytest.raises(ImageError, match=f"^{path}: .*{message}") as caught:
        read_candidate(path)
    assert "\n" not in str(caught.value)


def test_hdr_runs_truncated(tmp_path: Path) -> None:
    whole = hdr(rgbe(np.random.default_rng(4).uniform(0.1, 1.0, (20, 30, 3))), runs=True)
    path = tmp_path / "a.hdr"
    for cut in (1, 2, 100, 1500):
        path.write_bytes(whole[:-cut])
        with pytest.raises(ImageError, match="is truncated at row"):
            read_candidate(path)
    path.write_bytes(whole + b"\0")
    with pytest.raises(ImageError, match="has 1 bytes too many"):
        read_candidate(path)


def test_bad_png(tmp_path: Path) -> None:
    values = np.random.default_rng(5).integers(0, 65536, (64, 64, 3))
    for bits, cut in ((16, 4000), (8, 4000)):
        path = png(tmp_path / "a.png", values % (1 << bits), bits)
        path.write_bytes(path.read_bytes()[:-cut])
        with pytest.raises(ImageError, match=r"cannot be read: .*expected a whole image"):
            read_candidate(path)
    bomb = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 9**6, 9**6, 8, 2, 0, 0, 0))
    path.write_bytes(bomb + chunk(b"IDAT", b""))
    with pytest.raises(ImageError, match=f"expected at most {MOST_NUMBERS} values in total"):
        read_candidate(path)
    png(path, values % 256, 8, chunk(b"gAMA", struct.pack(">I", 100000)))
    with pytest.raises(ImageError, match="is encoded with gamma 1; expected sRGB"):
        read_candidate(path)


def test_bad_exr(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    picture = np.random.default_rng(6).uniform(0.0, 1.0, (64, 64, 3))
    path = exr(tmp_path / "a.exr", picture)
    whole = path.read_bytes()
    for cut in (1, 200, 20000):
        path.write_bytes(whole[:-cut])
        with pytest.raises(ImageError, match="it is truncated or damaged; expected a whole image"):
            read_candidate(path)
    path.write_bytes(whole[:100])
    with pytest.raises(ImageError, match="it is truncated or damaged; expected a whole image"):
        read_candidate(path)

    def window(name: bytes, size: int) -> None:
        content = path.read_bytes()
        at = content.index(name + b"\0box2i\0") + len(name) + 11
        box = struct.pack("<4i", 0, 0, size, size)
        path.write_bytes(content[:at] + box + content[at + 16 :])

    path.write_bytes(whole)
    window(b"dataWindow", 10**5)
    window(b"displayWindow", 10**5)
    with pytest.raises(ImageError, match="declares 100001 x 100001 pixels of 3 channels; expected"):
        read_candidate(path)
    path.write_bytes(whole)
    window(b"displayWindow", 127)
    with pytest.raises(
        ImageError, match=r"pixels from \(0, 0\) to \(63, 63\); expected all of its"
    ):
        read_candidate(path)
    with pytest.raises(ImageError, match="has channels A, B; expected R, G, B, or Y"):
        read_candidate(exr(path, picture, "AB"))
    with pytest.raises(ImageError, match=r"has channels B, G, R; expected no\.R, no\.G, no\.B, or"):
        read_candidate(exr(path, picture), "no")


def test_places_that_are_no_files(tmp_path: Path) -> None:
    with pytest.raises(ImageError, match="there is no such file; expected an image"):
        read_candidate(tmp_path / "none.exr")
    with pytest.raises(ImageError, match="Is a directory; expected an image"):
        read_candidate(tmp_path)
    path = tmp_path / "a.pfm"
    path.write_bytes(pfm(np.ones((1, 1, 3)), "-1"))
    with pytest.raises(ImageError, match="has no layer 'beauty'; expected"):
        read_candidate(path, "beauty")


@pytest.mark.skipif(sys.platform == "win32", reason="needs pipes by name")
def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    import os

    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ImageError, match="is a pipe, not a regular file; expected an image"):
        read_candidate(tmp_path / "pipe")


def test_bad_arrays() -> None:
    for array, message in (
        (np.ones((4, 4, 3), np.uint8), "array: holds uint8; expected floats of linear radiance"),
        (np.ones((4, 4)), r"array: has the shape \(4, 4\); expected \(height, width, 3\)"),
        (np.ones((2, 0, 4, 3)), "array: has 4 x 0 pixels; expected at least one"),
        (np.broadcast_to(np.ones(3), (1 << 20, 1 << 20, 3)), "array: declares 1048576 x 1048576"),
    ):
        with pytest.raises(ImageError, match=message):
            from_array(array)

"""Candidates from files: what is read is what was written, and what is none says so."""

import io
import struct
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from comparisons.gate.formats import MOST_NUMBERS
from comparisons.gate.pictures_in import from_array, read_candidate, read_candidates, variance_of
from reference_rt.errors import ImageError
from reference_rt.exr import write_exr
from reference_rt.shapes.shape import FloatArray
from reference_rt.textures.image_file import linear

HEIGHT, WIDTH = 5, 9


@pytest.fixture
def picture() -> FloatArray:
    """Exact in float32."""
    rng = np.random.default_rng(1)
    return np.float64(rng.uniform(0.0, 4.0, (HEIGHT, WIDTH, 3)).astype(np.float32))


def png(path: Path, values: np.ndarray, bits: int, more: bytes = b"") -> Path:
    """A PNG of values (height, width, channels), 1 to 4 of them, without filters."""
    height, width, channels = values.shape
    kind = {1: 0, 2: 4, 3: 2, 4: 6}[channels]
    rows = values.astype(">u2" if bits == 16 else "u1").reshape(height, -1)
    data = zlib.compress(b"".join(b"\0" + row.tobytes() for row in rows))
    head = struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, 0)
    chunks = [chunk(b"IHDR", head), more, chunk(b"IDAT", data), chunk(b"IEND", b"")]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))
    return path


def chunk(name: bytes, data: bytes) -> bytes:
    check = zlib.crc32(name + data)
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", check)


def pfm(values: np.ndarray, scale: str, kind: str = "<f4") -> bytes:
    letter = b"PF" if values.shape[2] == 3 else b"Pf"
    head = b"%s\n%d %d\n%s\n" % (letter, values.shape[1], values.shape[0], scale.encode())
    return head + values[::-1].astype(kind).tobytes()


def npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def exr(path: Path, picture: FloatArray, names: str = "RGB", prefix: str = "") -> Path:
    write_exr(path, {prefix + n: picture[..., k % 3] for k, n in enumerate(names)}, {})
    return path


# ---- what is read -------------------------------------------------------------------------------


def test_exr(tmp_path: Path, picture: FloatArray) -> None:
    found = read_candidate(exr(tmp_path / "a.exr", picture, "RGBA"))
    np.testing.assert_array_equal(found.radiance, picture)
    assert found.opacity is not None
    np.testing.assert_array_equal(found.opacity, picture[..., 0])
    assert not found.quantised
    layered = exr(tmp_path / "b.exr", picture, prefix="beauty.pass.")
    np.testing.assert_array_equal(read_candidate(layered, "beauty.pass").radiance, picture)
    grey = read_candidate(exr(tmp_path / "c.exr", picture, "Y"))
    np.testing.assert_array_equal(grey.radiance, np.repeat(picture[..., :1], 3, axis=-1))
    assert grey.opacity is None


def test_the_name_of_a_file_does_not_matter(tmp_path: Path, picture: FloatArray) -> None:
    path = exr(tmp_path / "a.exr", picture).rename(tmp_path / "a.png")
    np.testing.assert_array_equal(read_candidate(path).radiance, picture)


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_png(tmp_path: Path, bits: int, channels: int) -> None:
    most = (1 << bits) - 1
    values = np.random.default_rng(bits + channels).integers(0, most, (HEIGHT, WIDTH, channels))
    found = read_candidate(png(tmp_path / "a.png", values, bits))
    scaled = values / most
    has_opacity = channels in (2, 4)
    opacity = scaled[..., -1] if has_opacity else np.ones((HEIGHT, WIDTH))
    colour = scaled[..., :-1] if has_opacity else scaled
    expected = linear(np.broadcast_to(colour, (HEIGHT, WIDTH, 3))) * opacity[..., None]
    np.testing.assert_allclose(found.radiance, expected, rtol=1e-14)
    assert found.quantised == (bits == 8)
    if has_opacity:
        np.testing.assert_allclose(np.asarray(found.opacity), opacity, rtol=1e-15)
    else:
        assert found.opacity is None


def test_png_by_pillow_with_filters_and_a_palette(tmp_path: Path) -> None:
    values = np.random.default_rng(2).integers(0, 256, (64, 48, 3)).astype(np.uint8)
    Image.fromarray(values).save(tmp_path / "a.png", optimize=True)
    found = read_candidate(tmp_path / "a.png")
    np.testing.assert_allclose(found.radiance, linear(values / 255.0), rtol=1e-14)
    few = Image.fromarray(values // 64 * 64).convert("P", palette=Image.Palette.ADAPTIVE)
    few.save(tmp_path / "b.png")
    shown = np.asarray(few.convert("RGB")) / 255.0
    np.testing.assert_allclose(read_candidate(tmp_path / "b.png").radiance, linear(shown))


@pytest.mark.parametrize(("scale", "kind"), [("-1.0", "<f4"), ("1", ">f4")])
@pytest.mark.parametrize("channels", [1, 3])
def test_pfm(tmp_path: Path, picture: FloatArray, scale: str, kind: str, channels: int) -> None:
    (tmp_path / "a.pfm").write_bytes(pfm(picture[..., :channels], scale, kind))
    expected = np.broadcast_to(picture[..., :channels], picture.shape)
    np.testing.assert_array_equal(read_candidate(tmp_path / "a.pfm").radiance, expected)


@pytest.mark.parametrize("kind", ["<f8", "<f4", ">f4", "<f2"])
def test_npy(tmp_path: Path, picture: FloatArray, kind: str) -> None:
    values = picture.astype(kind)
    np.save(tmp_path / "a.npy", values)
    np.testing.assert_array_equal(read_candidate(tmp_path / "a.npy").radiance, np.float64(values))
    np.save(tmp_path / "b.npy", np.stack([values, values + 1]))
    both = read_candidates(tmp_path / "b.npy")
    np.testing.assert_array_equal(both[1].radiance, np.float64(values + 1))
    with pytest.raises(ImageError, match="holds 2 pictures; expected one"):
        read_candidate(tmp_path / "b.npy")
    (one,) = from_array(np.concatenate([values, values[..., :1]], axis=-1))
    np.testing.assert_array_equal(np.asarray(one.opacity), np.float64(values[..., 0]))


def rgbe(picture: FloatArray) -> np.ndarray:
    """(height, width, 4) as Radiance writes it: mantissas rounded down (Ward 1991)."""
    mantissa, exponent = np.frexp(picture.max(axis=-1, keepdims=True))
    scale = np.where(mantissa > 0.0, 256.0 * 2.0 ** -exponent.astype(np.float64), 0.0)
    return np.concatenate([picture * scale, exponent + 128], axis=-1).astype(np.uint8)


def hdr(values: np.ndarray, runs: bool, axes: str = "-Y {} +X {}", more: str = "") -> bytes:
    """A Radiance file of values (height, width, 4)."""
    height, width = values.shape[:2]
    head = (
        f"#?RADIANCE\n# a comment\n{more}FORMAT=32-bit_rle_rgbe\n\n{axes.format(height, width)}\n"
    )
    if not runs:
        return head.encode() + values.tobytes()
    body = bytearray()
    for row in values:
        body += b"\2\2" + struct.pack(">H", width)
        for channel in row.T:
            x = 0
            while x < width:
                same = 1
                while x + same < width and same < 127 and channel[x + same] == channel[x]:
                    same += 1
                body += bytes([128 + same, channel[x]]) if same > 2 else bytes([1, channel[x]])
                x += same if same > 2 else 1
    return head.encode() + bytes(body)


@pytest.mark.parametrize("runs", [True, False])
def test_hdr(tmp_path: Path, picture: FloatArray, runs: bool) -> None:
    picture[:, 3:7] = picture[0, 0]  # something to run over
    picture[2, 2] = 0.0
    values = rgbe(picture)
    (tmp_path / "a.hdr").write_bytes(hdr(values, runs))
    found = read_candidate(tmp_path / "a.hdr")
    assert found.quantised
    # Half a step of the mantissa, which has 8 bits of the largest channel.
    step = picture.max(axis=-1, keepdims=True) / 128.0
    assert (np.abs(found.radiance - picture) <= 0.5 * step).all()
    assert not found.radiance[2, 2].any()


def test_hdr_rounding_has_no_bias(tmp_path: Path) -> None:
    picture = np.random.default_rng(3).uniform(0.2, 0.9, (100, 100, 3))
    (tmp_path / "a.hdr").write_bytes(hdr(rgbe(picture), runs=True))
    found = read_candidate(tmp_path / "a.hdr").radiance
    # A step is at most 2^-8, rounding is uniform in it: 5 standard errors of 10^4 numbers.
    assert (np.abs((found - picture).mean(axis=(0, 1))) < 5 * 2**-8 / 12**0.5 / 100).all()


def test_hdr_axes_and_exposure(tmp_path: Path, picture: FloatArray) -> None:
    values = rgbe(picture)
    (tmp_path / "a.hdr").write_bytes(hdr(values, runs=False))
    plain = read_candidate(tmp_path / "a.hdr").radiance
    more = "EXPOSURE=2\nEXPOSURE=4\nCOLORCORR=1 2 1\n"
    (tmp_path / "b.hdr").write_bytes(hdr(values, False, "+Y {} -X {}", more))
    found = read_candidate(tmp_path / "b.hdr").radiance
    np.testing.assert_allclose(found, plain[::-1, ::-1] / np.array([8.0, 16.0, 8.0]))


def test_variance_of_a_layer_or_a_file(tmp_path: Path, picture: FloatArray) -> None:
    names = {f"variance.{n}": picture[..., k] for k, n in enumerate("RGB")}
    write_exr(tmp_path / "a.exr", names | dict.fromkeys("RGB", 0.0 * picture[..., 0]), {})
    np.testing.assert_array_equal(variance_of(tmp_path / "a.exr"), picture)
    np.testing.assert_array_equal(variance_of(exr(tmp_path / "b.exr", picture)), picture)
    with pytest.raises(ImageError, match=r"negative or not numbers; expected >= 0"):
        variance_of(exr(tmp_path / "c.exr", -picture))


# ---- what is refused ----------------------------------------------------------------------------

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
    "pfm bomb": (b"PF\n300000 200000\n-1\n", "declares 300000 x 200000 pixels of 3 channels"),
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
    "hdr turned": (_HDR.replace(b"-Y 20 +X 30", b"+X 20 -Y 30"), "malformed HDR header"),
    "hdr xyze": (_HDR.replace(b"rgbe", b"xyze") + bytes(2400), "format '32-bit_rle_xyze'; exp"),
    "hdr exposure": (b"#?\nEXPOSURE=0\n" + _HDR[11:] + bytes(2400), "'EXPOSURE=0'; expected posi"),
    "hdr truncated": (_HDR + bytes(2399), "is truncated: 2399 bytes of pixels; expected 2400"),
    "hdr too long": (_HDR + bytes(2401), "has 2401 bytes of pixels; expected 2400"),
    "hdr short": (_HDR + b"\2\2\0\x1e", "is truncated: too short for its size"),
    "hdr runs": (_HDR + b"\2\2\0\x1e\xff\7" + bytes(400), "is malformed at row 0; expected runs"),
    "hdr row": (_HDR + b"\2\2\0\x1f" + bytes(400), "is malformed at row 0; expected a scanline"),
    "hdr old runs": (_HDR + b"\1" * 2400, "has runs of the old kind"),
    "hdr bomb": (_HDR.replace(b"30", b"99999999"), "declares 99999999 x 20 pixels of 4 channels"),
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
        with pytest.raises(ImageError, match=r"cannot be read as PNG: .*expected a whole image"):
            read_candidate(path)
    bomb = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 9**6, 9**6, 8, 2, 0, 0, 0))
    path.write_bytes(bomb)
    with pytest.raises(ImageError, match=f"expected at most {MOST_NUMBERS} numbers in all"):
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
        with pytest.raises(ImageError, match="is truncated or damaged; expected a whole EXR"):
            read_candidate(path)
    path.write_bytes(whole[:100])
    with pytest.raises(ImageError, match="truncated or damaged header; expected a whole EXR"):
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
    with pytest.raises(ImageError, match="is not a file; expected an image"):
        read_candidate(tmp_path)
    path = tmp_path / "a.pfm"
    path.write_bytes(pfm(np.ones((1, 1, 3)), "-1"))
    with pytest.raises(ImageError, match="has no layer 'beauty': only EXR has layers"):
        read_candidate(path, "beauty")


@pytest.mark.skipif(sys.platform == "win32", reason="needs pipes by name")
def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    import os

    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ImageError, match="is not a file; expected an image"):
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

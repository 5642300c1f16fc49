"""OpenEXR files by the bytes of the format's description (OpenEXR File Layout): scanlines without
compression, whose channels may be subsampled; the library's writer takes whole ones only."""

import struct

import numpy as np

KINDS = {"<u4": 0, "<f2": 1, "<f4": 2}


def attribute(name, kind, value):
    return name + b"\0" + kind + b"\0" + struct.pack("<I", len(value)) + value


def exr(planes, sampling=None, more=b""):
    """planes: by name (height, width), of which those in `sampling` have a number every so many
    pixels in both directions."""
    sampling = sampling or {}
    names = sorted(planes)
    whole = next(planes[name] for name in names if name not in sampling)
    height, width = whole.shape
    channels = b"".join(
        name.encode() + b"\0" + struct.pack("<IIii", KINDS[planes[name].dtype.str], 0, s, s)
        for name in names
        for s in [sampling.get(name, 1)]
    )
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    head = b"v/1\x01" + struct.pack("<I", 2)
    head += attribute(b"channels", b"chlist", channels + b"\0") + more
    head += attribute(b"compression", b"compression", b"\0")
    head += attribute(b"dataWindow", b"box2i", window) + attribute(
        b"displayWindow", b"box2i", window
    )
    head += attribute(b"lineOrder", b"lineOrder", b"\0")
    head += attribute(b"pixelAspectRatio", b"float", struct.pack("<f", 1.0))
    head += attribute(b"screenWindowCenter", b"v2f", bytes(8))
    head += attribute(b"screenWindowWidth", b"float", struct.pack("<f", 1.0)) + b"\0"
    lines, offsets, at = [], [], len(head) + 8 * height
    for y in range(height):
        data = b"".join(
            planes[name][y // sampling.get(name, 1)].tobytes()
            for name in names
            if y % sampling.get(name, 1) == 0
        )
        lines.append(struct.pack("<iI", y, len(data)) + data)
        offsets.append(at)
        at += len(lines[-1])
    return head + np.array(offsets, "<u8").tobytes() + b"".join(lines)

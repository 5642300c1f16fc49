#!/usr/bin/env bash
# OpenEXR 3.5.3: whether compression changes a channel depends on its name or its type, not on what it holds.
# - DWAA: channels whose last part is R, G, B, Y, RY or BY lose digits ("albedo.R", "variance.R", "left.R"), all
#   others are kept to the bit ("r", "red", "R.left", "normal.x", "depth"): a variance named as a colour is spoilt,
#   and a colour named "red" is not compressed.
# - B44 spoils halves and keeps floats, PXR24 spoils floats and keeps halves, whatever their names.
# Seen on 2026-11-28.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check OpenEXR==3.5.3 numpy==2.4.6
venv/bin/python - <<'END'
import numpy as np
import OpenEXR

NAMES = "R G B Y RY albedo.R variance.R left.R A Z r red R.left depth normal.x".split()
VALUES = np.random.default_rng(1).random((64, 64), dtype=np.float32)


def spoilt(compression, dtype):
    """The names of the channels that come back changed."""
    values = VALUES.astype(dtype)
    header = {"compression": getattr(OpenEXR, compression), "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {name: values.copy() for name in NAMES}) as file:
        file.write("all.exr")
    read = OpenEXR.File("all.exr", separate_channels=True).channels()
    return [name for name in NAMES if not np.array_equal(read[name].pixels, values)]


for dtype in ("float16", "float32"):
    for compression in ("DWAA_COMPRESSION", "B44_COMPRESSION", "PXR24_COMPRESSION", "ZIP_COMPRESSION"):
        print(dtype, compression, "changes", spoilt(compression, dtype))

LOSSY = "R G B Y RY albedo.R variance.R left.R".split()
assert spoilt("DWAA_COMPRESSION", "float16") == spoilt("DWAA_COMPRESSION", "float32") == LOSSY
assert spoilt("B44_COMPRESSION", "float16") == NAMES and spoilt("B44_COMPRESSION", "float32") == []
assert spoilt("PXR24_COMPRESSION", "float32") == NAMES and spoilt("PXR24_COMPRESSION", "float16") == []
END

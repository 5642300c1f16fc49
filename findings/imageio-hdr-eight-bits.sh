#!/usr/bin/env bash
# imageio 2.38.1 with OpenCV 5.0.0 reads a Radiance .hdr file as eight bits: radiance 200 becomes 255 and 1.0 becomes
# 255, too, without a warning; `imageio.v3.imread` has no argument that says so. OpenCV itself gives floats if it is
# asked for the picture unchanged, which imageio does by `flags`. Seen on 2026-11-28.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check imageio==2.38.1 opencv-python-headless==5.0.0.93 numpy==2.4.6
printf '#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\200\100\040\201\310\144\062\210' > two.hdr
venv/bin/python - <<'END'
import cv2
import imageio.v3 as imageio

plain = imageio.imread("two.hdr")
floats = imageio.imread("two.hdr", flags=cv2.IMREAD_UNCHANGED)
print(plain.dtype, plain.tolist(), "unchanged:", floats.dtype, floats.tolist())
assert plain.dtype == "uint8"
assert plain[0, 0, 0] == 255 and plain[0, 1, 0] == 255
assert floats[0, :, 0].tolist() == [1.0, 200.0]
END

#!/usr/bin/env bash
# A PFM file of colours, whose third line is the scale, -2.0, and whose rows begin at the bottom, as the format says, holds 1, 4,
# 7, 10 from the top down. OpenCV 5.0.0 reads half of it, OpenImageIO 3.2.2 twice as much, the bottom row first; imageio 2.38.1
# by its default plugin reads whole numbers of 8 bits. With a scale of -1.0, which is what all writers write, the first two
# agree but for OpenImageIO's rows. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install -q --disable-pip-version-check opencv-python-headless==5.0.0.93 OpenImageIO==3.2.2.0 imageio==2.38.1 numpy==2.4.6
cd "$work"
"$work/venv/bin/python" - <<'END'
import cv2
import imageio.v3 as imageio
import numpy as np
import OpenImageIO

rows = np.array([1, 4, 7, 10], "<f4")
picture = np.repeat(np.repeat(rows[:, None], 3, axis=1)[..., None], 3, axis=2)
found = {}
for scale in (b"-1.0", b"-2.0"):
    with open("rows.pfm", "wb") as file:
        file.write(b"PF\n3 4\n" + scale + b"\n" + picture[::-1].tobytes())
    for name, values in {
        "OpenCV": cv2.imread("rows.pfm", cv2.IMREAD_UNCHANGED),
        "OpenImageIO": OpenImageIO.ImageBuf("rows.pfm").get_pixels(OpenImageIO.FLOAT),
        "imageio": imageio.imread("rows.pfm"),
    }.items():
        found[scale, name] = values[:, 0, 0].tolist()
        print(f"scale {scale.decode()}, {name}: from the top {found[scale, name]}, {values.dtype}")
assert found[b"-1.0", "OpenCV"] == [1, 4, 7, 10]
assert found[b"-2.0", "OpenCV"] == [0.5, 2, 3.5, 5]
assert found[b"-1.0", "OpenImageIO"] == [10, 7, 4, 1]
assert found[b"-2.0", "OpenImageIO"] == [20, 14, 8, 2]
assert found[b"-2.0", "imageio"] == [0, 2, 4, 5]
END

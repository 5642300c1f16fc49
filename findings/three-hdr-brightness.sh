#!/usr/bin/env bash
# three.js 0.187.0, HDRLoader: every value of a Radiance .hdr file is 256/255 = 1.0039 of what OpenCV, OpenImageIO
# and the format's description give: it divides mantissas by 255. An exponent of 129 and a mantissa of 128 is 1.0, and
# is read as 1.0039. Seen on 2026-11-28.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check opencv-python-headless==5.0.0.93 OpenImageIO==3.2.2.0 numpy==2.4.6
npm install --silent --no-audit --no-fund three@0.187.0
printf '#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n\200\100\040\201' > one.hdr
cat > read.mjs <<'END'
import { readFileSync } from "node:fs";
import { FloatType } from "three";
import { HDRLoader } from "three/examples/jsm/loaders/HDRLoader.js";

const bytes = readFileSync("one.hdr");
const loader = new HDRLoader().setDataType(FloatType);
const { data } = loader.parse(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
console.log(JSON.stringify(Array.from(data.slice(0, 3))));
END
node read.mjs > three.json
venv/bin/python - <<'END'
import json

import cv2
import OpenImageIO

others = {
    "OpenCV": cv2.imread("one.hdr", cv2.IMREAD_UNCHANGED)[0, 0, ::-1].tolist(),
    "OpenImageIO": OpenImageIO.ImageBuf("one.hdr").get_pixels(OpenImageIO.FLOAT)[0, 0].tolist(),
}
three = json.load(open("three.json"))
print(others, "three.js", three)
assert all(pixel == [1.0, 0.5, 0.25] for pixel in others.values())
assert all(abs(a / b - 256 / 255) < 1e-6 for a, b in zip(three, [1.0, 0.5, 0.25]))
END

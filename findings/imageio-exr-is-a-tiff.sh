#!/usr/bin/env bash
# imageio 2.38.1 with tifffile 2026.3.3: imwrite("picture.exr", floats) succeeds and writes a TIFF under that name. Programs that
# go by the first bytes read it, those that expect OpenEXR do not. Without tifffile it is refused. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check imageio==2.38.1 tifffile==2026.3.3 numpy==2.4.6 OpenEXR==3.5.3
cat > write.py <<'END'
import imageio.v3 as imageio
import numpy as np
import OpenEXR

imageio.imwrite("picture.exr", np.ones((4, 4, 3), np.float32))
print("begins with", open("picture.exr", "rb").read(4))
OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": np.ones((4, 4, 3), np.float32)}).write("right.exr")
print("OpenEXR begins with", open("right.exr", "rb").read(4))
END
venv/bin/python write.py | tee seen
diff seen - <<'END'
begins with b'II*\x00'
OpenEXR begins with b'v/1\x01'
END

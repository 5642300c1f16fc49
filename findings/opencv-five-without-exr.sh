#!/usr/bin/env bash
# OpenCV 5.0.0 (opencv-python-headless from PyPI): imread of an EXR file gives None, and imwrite finds no writer: its wheel is built
# without OpenEXR, whatever OPENCV_IO_ENABLE_OPENEXR says, which made 4.14.0's read the same file. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
export OPENCV_IO_ENABLE_OPENEXR=1 OPENCV_LOG_LEVEL=OFF
python3 -m venv write
write/bin/pip install -q --disable-pip-version-check OpenEXR==3.5.3 numpy==2.4.6
write/bin/python -c "
import numpy as np, OpenEXR
OpenEXR.File({'type': OpenEXR.scanlineimage}, {'RGB': np.full((4, 4, 3), 2.0, np.float32)}).write('two.exr')"
for version in 4.14.0.94 5.0.0.93; do
  python3 -m venv "$version"
  "$version/bin/pip" install -q --disable-pip-version-check "opencv-python-headless==$version"
  "$version/bin/python" -c "
import cv2
found = cv2.imread('two.exr', cv2.IMREAD_UNCHANGED)
print(cv2.__version__, None if found is None else float(found[0, 0, 0]))" 2>/dev/null
done | tee seen
diff seen - <<'END'
4.14.0 2.0
5.0.0 None
END

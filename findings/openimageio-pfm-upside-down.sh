#!/usr/bin/env bash
# OpenImageIO 3.2.2.0: a PFM that it writes comes back upside down. The file is right (its first row is the picture's last,
# as the format wants it); the reader gives the rows in the file's order. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check openimageio==3.2.2.0 numpy==2.4.6
cat > rows.py <<'END'
import struct

import numpy as np
import OpenImageIO as oiio

rows = np.repeat(np.arange(1.0, 4.0, dtype=np.float32), 2 * 3).reshape(3, 2, 3)
out = oiio.ImageOutput.create("a.pfm")
out.open("a.pfm", oiio.ImageSpec(2, 3, 3, "float"))
out.write_image(rows)
out.close()
data = open("a.pfm", "rb").read()
print("written", rows[:, 0, 0].tolist(), "in the file", [struct.unpack_from("<f", data, len(data) - 72 + 24 * k)[0] for k in range(3)])
print("read", oiio.ImageInput.open("a.pfm").read_image("float")[:, 0, 0].tolist())
END
venv/bin/python rows.py | tee seen
diff seen - <<'END'
written [1.0, 2.0, 3.0] in the file [3.0, 2.0, 1.0]
read [3.0, 2.0, 1.0]
END

#!/usr/bin/env bash
# tachyon 0.99b6 (Debian 12): with VIEWDIR 0 0 -1 and UPDIR 0 1 0, what is at positive x is on the left of the picture; and
# rays go through the corners of pixels: a ball at x = 0.35, y = 0.6 is, once the picture is mirrored, where a ray tracer
# that samples the pixels' centres sees it half a pixel further right and down, pixel for pixel. The height of the view is
# 1 / ZOOM at distance 1. Seen on 2026-11-29 (needs apt install tachyon).
set -euo pipefail
command -v tachyon > /dev/null || { echo "needs tachyon: apt install tachyon"; exit 1; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
cat > ball.dat <<'END'
BEGIN_SCENE
RESOLUTION 64 64
CAMERA
ZOOM 1.25
ASPECTRATIO 1.0
ANTIALIASING 0
RAYDEPTH 3
CENTER 0.0 0.0 0.0
VIEWDIR 0.0 0.0 -1.0
UPDIR 0.0 1.0 0.0
END_CAMERA
BACKGROUND 0 0 0
SPHERE CENTER 0.35 0.6 -4.0 RAD 0.7
TEXTURE AMBIENT 1.0 DIFFUSE 0.0 SPECULAR 0.0 OPACITY 1.0 COLOR 0.5 0.5 0.5 TEXFUNC 0
END_SCENE
END
tachyon ball.dat -format PPM48 -o out.ppm > log || { cat log; exit 1; }
grep -m 1 -o 'Version 0.99[^ ]*' log
python3 - <<'END'
import struct

N = 64
data = open("out.ppm", "rb").read()[-6 * N * N:]
shown = [[struct.unpack_from(">H", data, 6 * (N * j + i))[0] > 0 for i in range(N)] for j in range(N)]


def seen(i, j, right, down):
    """Whether the ball is seen at pixel i, j of a picture that lies so many pixels further."""
    x = ((i + 0.5 - right) / N - 0.5) / 1.25
    y = (0.5 - (j + 0.5 - down) / N) / 1.25
    d, c = (x, y, -1.0), (0.35, 0.6, -4.0)
    along = sum(a * b for a, b in zip(d, c))
    return along**2 - sum(a * a for a in d) * (sum(a * a for a in c) - 0.7**2) > 0.0


def wrong(mirrored, right, down):
    pixels = [(i, j) for i in range(N) for j in range(N)]
    return sum(shown[j][N - 1 - i if mirrored else i] != seen(i, j, right, down) for i, j in pixels)


print("pixels that differ: as it is", wrong(False, 0, 0), "mirrored", wrong(True, 0, 0),
      "mirrored and moved", wrong(True, 0.5, 0.5))
assert wrong(False, 0, 0) > 100 and wrong(True, 0, 0) > 10 and wrong(True, 0.5, 0.5) == 0
END

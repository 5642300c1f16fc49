#!/usr/bin/env bash
# What gates make of alpha, seen by two pictures of random colours, of 64 x 64 pixels of RGBA each:
# - Pillow 13.0.0: ImageChops.difference(one, other).getbbox() is None, "no difference", for any two opaque pictures, black and
#   white too: alpha's difference is 0 there, and getbbox leaves out what is transparent, unless alpha_only=False, as its documentation says.
# - looks-same 10.0.1 (npm), with `strict` too, and ssim.js 3.5.0: a picture is equal to the same one with alpha 0 everywhere,
#   of which a browser shows nothing. Both find other colours.
# - pixelmatch 8.0.0 and odiff 4.5.0 find all of these. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check Pillow==13.0.0 numpy==2.4.6
npm install --silent --no-audit --no-fund looks-same@10.0.1 ssim.js@3.5.0 pixelmatch@8.0.0 odiff-bin@4.5.0 pngjs@7.0.0
venv/bin/python - <<'END_OF_PYTHON'
import numpy as np
from PIL import Image, ImageChops

random = np.random.default_rng(1)
one, other = (random.integers(0, 256, (64, 64, 4), dtype=np.uint8) for _ in range(2))
one[..., 3] = other[..., 3] = 255
clear = one.copy()
clear[..., 3] = 0
for name, values in {"one": one, "other": other, "clear": clear}.items():
    Image.fromarray(values).save(f"{name}.png")
black, white = (Image.new("RGBA", (64, 64), (value, value, value, 255)) for value in (0, 255))
for first, second in (black, white), (Image.open("one.png"), Image.open("other.png")):
    difference = ImageChops.difference(first, second)
    print("Pillow:", difference.getbbox(), "with alpha_only=False:", difference.getbbox(alpha_only=False))
    assert difference.getbbox() is None and difference.getbbox(alpha_only=False) == (0, 0, 64, 64)
assert ImageChops.difference(black.convert("RGB"), white.convert("RGB")).getbbox() == (0, 0, 64, 64)
END_OF_PYTHON
cat > gates.mjs <<'END_OF_SCRIPT'
import { readFileSync } from "node:fs";
import looksSame from "looks-same";
import { compare } from "odiff-bin";
import pixelmatch from "pixelmatch";
import { PNG } from "pngjs";
import { ssim } from "ssim.js";

const read = (name) => PNG.sync.read(readFileSync(`${name}.png`));
const one = read("one");
for (const name of ["one", "clear", "other"]) {
  const picture = read(name);
  console.log(name, JSON.stringify({
    looksSame: (await looksSame("one.png", `${name}.png`)).equal,
    strict: (await looksSame("one.png", `${name}.png`, { strict: true })).equal,
    ssim: ssim(one, picture).mssim > 0.999999,
    pixelmatch: pixelmatch(one.data, picture.data, null, 64, 64) === 0,
    odiff: (await compare("one.png", `${name}.png`, "difference.png")).match,
  }));
}
END_OF_SCRIPT
node gates.mjs | tee seen
diff seen - <<'END_OF_LINES'
one {"looksSame":true,"strict":true,"ssim":true,"pixelmatch":true,"odiff":true}
clear {"looksSame":true,"strict":true,"ssim":true,"pixelmatch":false,"odiff":false}
other {"looksSame":false,"strict":false,"ssim":false,"pixelmatch":false,"odiff":false}
END_OF_LINES

"""A folder of scenes as a contact sheet: `python examples/batch.py FOLDER OUT.png`."""

import io
import sys
from pathlib import Path

import numpy as np
from PIL import Image

from reference_rt import Scene, SceneError

if len(sys.argv) != 3:
    sys.exit(__doc__)
folder, out = Path(sys.argv[1]), sys.argv[2]
sheet = []
for path in sorted(folder.glob("*.yaml")):
    try:
        picture = Scene.load(path).preview(width=80, spp=16)
    except SceneError as error:  # one line: file, line, key, what was expected
        print(error)
        continue
    print(f"{path.stem}: {picture}")
    colour = np.array(Image.open(io.BytesIO(picture.png())))
    padded = np.zeros((80, 80, 3), np.uint8)
    padded[: len(colour)] = colour[:80]
    sheet.append(padded)
columns = max(1, round(len(sheet) ** 0.5))
sheet += [np.zeros((80, 80, 3), np.uint8)] * (-len(sheet) % columns)
rows = [np.concatenate(sheet[k : k + columns], axis=1) for k in range(0, len(sheet), columns)]
Image.fromarray(np.concatenate(rows)).save(out)

#!/usr/bin/env bash
# Mitsuba 3.9.1: `far_clip` ends what a camera sees, but not behind a surface that is none (`null`): there `volpath` and `volpathmis`
# go on with a new ray, which has no end. A lamp behind the far plane is black, and has its radiance through a sheet of nothing that
# stands before that plane. So nobody should clip a scene that has a volume in it. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check mitsuba==3.9.1 numpy==2.4.6
cat > clip.py <<'END'
import sys

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")
mi.set_log_level(mi.LogLevel.Error)
at = mi.ScalarTransform4f


def seen(integrator, sheet):
    """The lamp at a distance of 5 by a camera that sees up to 3, with or without the sheet at 2."""
    scene = {
        "type": "scene",
        "integrator": {"type": integrator},
        "sensor": {
            "type": "perspective",
            "fov": 10,
            "near_clip": 0.1,
            "far_clip": 3.0,
            "film": {"type": "hdrfilm", "width": 4, "height": 4, "rfilter": {"type": "box"}},
        },
        "lamp": {
            "type": "rectangle",
            "to_world": at().translate([0, 0, 5]).rotate([0, 1, 0], 180),
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 1.0}},
        },
    }
    if sheet:
        scene["sheet"] = {"type": "rectangle", "to_world": at().translate([0, 0, 2]), "bsdf": {"type": "null"}}
    return float(np.array(mi.render(mi.load_dict(scene), spp=4)).mean())


good = True
for name in ("volpath", "volpathmis"):
    alone, behind = seen(name, False), seen(name, True)
    print(f"{name}: the lamp beyond the far plane {alone:g}, behind a sheet of nothing {behind:g}")
    good &= alone == 0.0 and abs(behind - 1.0) < 1e-5
sys.exit(0 if good else 1)
END
venv/bin/python clip.py

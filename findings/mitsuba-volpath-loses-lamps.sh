#!/usr/bin/env bash
# Mitsuba 3.9.1, integrators `volpath` and `volpathmis`: behind surfaces with the BSDF `null` the light of area lamps is
# lost. A shadow ray goes on behind each one ray epsilon, (1 + max |p|) 8.9e-5, further, and yet as far as was left before.
# It ends 8.9e-4 of the distance short of the lamp: once the steps add up to more, it ends behind the lamp's surface,
# which then hides its light. So a floor under a small lamp, with no medium at all, is as bright as without any sheet
# between them, or dark: light stays if the sum of (1 + max |p|) over the sheets is below 10 times the lamp's distance.
# At x = 9 one sheet is enough to lose all. A point lamp, which has no surface, keeps its light. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check mitsuba==3.9.1 numpy==2.4.6
venv/bin/python - <<'END'
import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")
Transform = mi.ScalarTransform4f


def heights(sheets):
    return [0.2 + 0.6 * k / max(1, sheets - 1) for k in range(sheets)]


def brightness(integrator, x, sheets, point=False):
    """Of the floor at (x, 0, 0), below a lamp of side 0.02."""
    scene = {
        "type": "scene",
        "integrator": {"type": integrator, "max_depth": 2},
        "sensor": {
            "type": "perspective", "fov": 1, "near_clip": 1e-3,
            "to_world": Transform().look_at([x, 0, 0.1], [x, 0, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}},
            "sampler": {"type": "independent", "sample_count": 256},
        },
        "floor": {"type": "rectangle", "to_world": Transform().scale(100)},
    }
    if point:
        scene["lamp"] = {"type": "point", "position": [x, 0, 1]}
    else:
        place = Transform().translate([x, 0, 1]).rotate([1, 0, 0], 180).scale(0.01)
        emitter = {"type": "area", "radiance": 100.0}
        scene["lamp"] = {"type": "rectangle", "to_world": place, "emitter": emitter}
    for k, z in enumerate(heights(sheets)):
        place = Transform().translate([x, 0, z]).scale(0.5)
        scene[f"sheet{k}"] = {"type": "rectangle", "to_world": place, "bsdf": {"type": "null"}}
    return float(np.array(mi.render(mi.load_dict(scene), seed=1)).mean())


for integrator in ("volpath", "volpathmis"):
    for x in (0, 2, 9):
        clear = brightness(integrator, x, 0)
        shares = [brightness(integrator, x, k) / clear for k in range(13)]
        print(integrator, f"x = {x}: share of the light behind 0, 1, ... sheets:", np.round(shares, 3))
        for sheets, share in enumerate(shares):
            steps = sum(1.0 + max(x, z) for z in heights(sheets))
            assert share > 0.99 if steps < 9.9 else share < 0.01
    spot = [brightness(integrator, 9, k, True) for k in (0, 6)]
    print(integrator, "a point lamp's behind 6 sheets:", round(spot[1] / spot[0], 4))
    assert abs(spot[1] / spot[0] - 1.0) < 1e-3
END

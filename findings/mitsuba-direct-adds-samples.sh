#!/usr/bin/env bash
# Mitsuba 3.9.1, integrator `direct`: `emitter_samples` multiplies the light of point and directional lamps. With 4 the
# floor under such a lamp is 4 times as bright as with 1; an area lamp stays the same. (The samples of a lamp that
# no BSDF sample can meet are weighted by 1 each, not by their share.) Seen on 2026-11-28.
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
LAMPS = {
    "point": {"type": "point", "position": [0, 0, 2]},
    "directional": {"type": "directional", "direction": [0, 0, -1]},
    "area": {
        "type": "rectangle",
        "to_world": Transform().translate([0, 0, 3]).rotate([1, 0, 0], 180).scale(0.5),
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 5.0}},
    },
}


def brightness(lamp, samples):
    scene = mi.load_dict({
        "type": "scene",
        "integrator": {"type": "direct", "emitter_samples": samples, "bsdf_samples": 1},
        "sensor": {
            "type": "perspective", "fov": 20,
            "to_world": Transform().look_at([0, 0, 2.5], [0, 0, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": 16, "height": 16, "rfilter": {"type": "box"}},
            "sampler": {"type": "independent", "sample_count": 64},
        },
        "floor": {"type": "rectangle", "to_world": Transform().scale(10)},
        "lamp": LAMPS[lamp],
    })
    return float(np.array(mi.render(scene, seed=1)).mean())


ratios = {lamp: brightness(lamp, 4) / brightness(lamp, 1) for lamp in LAMPS}
print("brightness with 4 samples of the lamp over that with 1:", ratios)
assert abs(ratios["point"] - 4.0) < 0.02 and abs(ratios["directional"] - 4.0) < 0.02
assert abs(ratios["area"] - 1.0) < 0.02
END

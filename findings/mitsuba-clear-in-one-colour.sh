#!/usr/bin/env bash
# Mitsuba 3.9.1: a homogeneous medium that is clear in one colour only (`sigma_t` 1, 0.5 and 0) scatters nothing in any colour
# with `volpathmis`, and is no number with `volpath`. A layer of albedo 1 in a sky of 1 cannot be seen: all of it is 1. It is
# exp(-1), exp(-0.5) and 1 with `volpathmis`, as if it only absorbed; NaN with `volpath`. With 0.001 in place of 0 it is 1 in
# red and green. Seen on 2026-11-29.
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
mi.set_log_level(mi.LogLevel.Error)
Transform = mi.ScalarTransform4f


def colour(integrator, blue):
    scene = mi.load_dict({
        "type": "scene",
        "integrator": {"type": integrator, "max_depth": -1, "rr_depth": 100000},
        "sensor": {
            "type": "perspective", "fov": 1, "to_world": Transform().look_at([0, 0, 1], [0, 0, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}},
            "sampler": {"type": "independent", "sample_count": 2048},
        },
        "layer": {
            "type": "cube", "to_world": Transform().translate([0, 0, -0.5]).scale([1000, 1000, 0.5]),
            "bsdf": {"type": "null"},
            "interior": {
                "type": "homogeneous", "albedo": 1.0,
                "sigma_t": {"type": "rgb", "value": [1.0, 0.5, blue]},
            },
        },
        "sky": {"type": "constant", "radiance": 1.0},
    })
    return np.array(mi.render(scene))[..., :3].mean(axis=(0, 1))


found = {(name, b): colour(name, b) for name in ("volpath", "volpathmis") for b in (0.001, 0.0)}
for (name, blue), value in found.items():
    print(f"{name}, blue {blue}:", value)
assert np.isnan(found["volpath", 0.0]).all()
assert np.allclose(found["volpathmis", 0.0], np.exp([-1.0, -0.5, 0.0]), atol=0.01)
assert np.allclose(found["volpathmis", 0.001][:2], 1.0, atol=0.02)
END

#!/usr/bin/env bash
# Mitsuba 3.9.1, phase function `hg`: for light that goes straight on its value is (1 + g) / (4 pi (1 - g)^2). In float32, as `scalar_rgb`
# has it, it is 0.03 % off for g = 0.99, 7 % for 0.999, and infinite for 0.9999: 1 + g^2 - 2 g cosine is a difference of
# numbers that are alike. (1 - g)^2 + 2 g (1 - cosine) would keep its digits. A ball of albedo 1 cannot be seen in a sky of 1,
# whatever its g: with -0.99 it cannot, with -0.9999 half of the light is missing. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check mitsuba==3.9.1 drjit==1.5.0 numpy==2.4.6
venv/bin/python - <<'END'
import math
import sys

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")


def straight_on(g):
    """The value for light that goes straight on, over the formula's."""
    there = mi.MediumInteraction3f()
    there.wi = mi.Vector3f(0.0, 0.0, -1.0)
    there.sh_frame = mi.Frame3f(there.wi)
    phase = mi.load_dict({"type": "hg", "g": g})
    value = phase.eval_pdf(mi.PhaseFunctionContext(), there, mi.Vector3f(0.0, 0.0, 1.0))[1]
    return value / ((1.0 + g) / (4.0 * math.pi * (1.0 - g) ** 2))


def ball(g):
    """The mean of pixels that see the middle of a white ball in a sky of 1, and its error."""
    T = mi.ScalarTransform4f
    picture = mi.render(mi.load_dict({
        "type": "scene",
        "integrator": {"type": "volpath", "rr_depth": 1000},
        "sensor": {
            "type": "orthographic",
            "to_world": T().look_at([0, 0, 4], [0, 0, 0], [0, 1, 0]) @ T().scale([1e-3, 1e-3, 1]),
            "film": {"type": "hdrfilm", "width": 16, "height": 16, "rfilter": {"type": "box"}},
            "sampler": {"type": "independent", "sample_count": 64},
        },
        "ball": {
            "type": "sphere",
            "bsdf": {"type": "null"},
            "interior": {
                "type": "homogeneous", "albedo": 1.0, "sigma_t": 1.0,
                "phase": {"type": "hg", "g": g},
            },
        },
        "sky": {"type": "constant", "radiance": 1.0},
    }))
    pixels = np.array(picture).mean(axis=2).ravel()
    return pixels.mean(), pixels.std(ddof=1) / 16.0


values = {g: straight_on(g) for g in (0.99, 0.999, 0.9999)}
for g, ratio in values.items():
    print(f"g = {g}: straight on {ratio:.5f} of the formula")
right, narrow = ball(-0.99), ball(-0.9999)
for name, (mean, error) in (("-0.99", right), ("-0.9999", narrow)):
    print(f"a white ball of g = {name}: {mean:.3f} ± {error:.3f}; expected 1")
off = abs(values[0.999] - 1.0) > 0.005 and not math.isfinite(values[0.9999])
sys.exit(0 if off and abs(right[0] - 1.0) < 0.03 and narrow[0] < 0.9 else 1)
END

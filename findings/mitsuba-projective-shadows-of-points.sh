#!/usr/bin/env bash
# Mitsuba 3.9.1, `direct_projective` and `prb_projective`, with any guiding: an edge of a shadow that moves has no derivative if the
# lamp has no extent (`directional`, `point`), without a warning. Edges are found by rays that scatter, and no ray finds such a
# lamp. A black screen hides half of a white floor from the lamp; its edge moves. Differences of Mitsuba's own pictures have the
# closed form: floor's radiance times the edge's speed over the width of the view, .364. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check mitsuba==3.9.1 drjit==1.5.0 numpy==2.4.6 karellen-llvm-core==19.1.7
export DRJIT_LIBLLVM_PATH=$(find "$work/venv" -name 'libLLVM.so.*' | head -1)
cat > shadow.py <<'END'
import math

import drjit as dr
import mitsuba as mi

mi.set_variant("llvm_ad_rgb")
mi.set_log_level(mi.LogLevel.Error)
T = mi.ScalarTransform4f
WIDTH = 2 * 0.5 * math.tan(math.radians(20))
# Each lamp, and the speed of the shadow's edge when the screen's edge moves by 1.
LAMPS = {
    "directional": ({"type": "directional", "direction": [0, 0, -1], "irradiance": 1.0}, 1.0),
    "point": ({"type": "point", "position": [0, 0, 3], "intensity": 9.0}, 1.5),
}


def scene(lamp):
    film = {"type": "hdrfilm", "width": 4, "height": 4, "rfilter": {"type": "box"}}
    view = T().look_at([0, 0, 0.5], [0, 0, 0], [0, 1, 0])
    black = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": 0.0}}
    return mi.load_dict({
        "type": "scene",
        "sensor": {"type": "perspective", "fov": 40, "to_world": view, "film": film},
        "floor": {
            "type": "rectangle",
            "to_world": T().scale(50),
            "bsdf": {"type": "diffuse", "reflectance": 0.8},
        },
        "screen": {
            "type": "rectangle",
            "to_world": T().translate([-10, 0, 1]) @ T().scale(10),
            "bsdf": black,
        },
        "lamp": lamp,
    })


def picture(lamp, integrator, x):
    """The mean; x: where the screen's edge is."""
    loaded = scene(lamp)
    values = mi.traverse(loaded)
    moved = mi.Transform4f().translate(mi.Vector3f(-10 + x, 0, 1)) @ mi.Transform4f().scale(10)
    values["screen.to_world"] = moved
    values.update()
    made = mi.load_dict(integrator)
    return dr.mean(mi.render(loaded, params=values, integrator=made, spp=4096, seed=1), axis=None)


for name, (lamp, speed) in LAMPS.items():
    right = -0.8 / math.pi * speed / WIDTH
    step = 0.05
    ends = [picture(lamp, {"type": "direct"}, mi.Float(x)).numpy().item() for x in (-step, step)]
    told = ["differences of its pictures %.1f" % ((ends[1] - ends[0]) / (2 * step) / right)]
    for integrator in (
        {"type": "direct_projective"},
        {"type": "direct_projective", "guiding": "none"},
        {"type": "prb_projective", "max_depth": 2},
    ):
        x = mi.Float(0.0)
        dr.enable_grad(x)
        mean = picture(lamp, integrator, x)
        dr.forward(x)
        words = " ".join([integrator["type"], integrator.get("guiding", "octree")])
        told.append("%s %.1f" % (words, abs(dr.grad(mean).numpy().item()) / abs(right)))
    print("%s: of the derivative, %s" % (name, ", ".join(told)))
END
venv/bin/python shadow.py | sed 's/\x1b\[[0-9;]*m//g' | tee seen
diff seen - <<'END'
directional: of the derivative, differences of its pictures 1.0, direct_projective octree 0.0, direct_projective none 0.0, prb_projective octree 0.0
point: of the derivative, differences of its pictures 1.0, direct_projective octree 0.0, direct_projective none 0.0, prb_projective octree 0.0
END

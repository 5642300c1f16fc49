#!/usr/bin/env bash
# Mitsuba 3.9.1, `direct_projective` and `prb_projective`: the derivative by an outline of a `rectangle` that moves in the picture is too
# small if the rectangle is turned: by the factor (|a| + |b|) / 2 for a square with a and b on the diagonal of its rotation, as if its
# perimeter were that of its matrix's diagonal. Turned by 60 degrees in its own plane, which changes nothing else, half is left;
# tilted by as much, three quarters. A `disk` is right. A white lamp before a black sky grows; the mean of the picture is
# its area in the plane of the film over 4. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check mitsuba==3.9.1 drjit==1.5.0 numpy==2.4.6 karellen-llvm-core==19.1.7
export DRJIT_LIBLLVM_PATH=$(find "$work/venv" -name 'libLLVM.so.*' | head -1)
cat > turned.py <<'END'
import math

import drjit as dr
import mitsuba as mi

mi.set_variant("llvm_ad_rgb")
mi.set_log_level(mi.LogLevel.Error)
T = mi.ScalarTransform4f
HALF = 0.3


def share(kind, area, angle, integrator):
    """Of the exact derivative of the mean by half the lamp's size."""
    film = {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}}
    view = T().look_at([0, 0, 1], [0, 0, 0], [0, 1, 0])
    scene = mi.load_dict({
        "type": "scene",
        "sensor": {"type": "perspective", "fov": 90, "to_world": view, "film": film},
        "lamp": {
            "type": kind,
            "to_world": T().rotate([0, 0, 1], angle) @ T().scale(HALF),
            "emitter": {"type": "area", "radiance": 1.0},
        },
    })
    values = mi.traverse(scene)
    size = mi.Float(HALF)
    dr.enable_grad(size)
    turned = mi.Transform4f().rotate(mi.Vector3f(0, 0, 1), angle)
    values["lamp.to_world"] = turned @ mi.Transform4f().scale(size)
    values.update()
    made = mi.load_dict({"type": integrator, "guiding": "none"})
    picture = mi.render(scene, params=values, integrator=made, spp=4096, seed=1)
    dr.forward(size)
    return dr.grad(picture).numpy().mean() / (area * 2 * HALF / 4)


for kind, area in (("rectangle", 4), ("disk", math.pi)):
    for integrator in ("direct_projective", "prb_projective"):
        shares = ["%.2f" % share(kind, area, angle, integrator) for angle in (0, 30, 60, 80)]
        print("%s, %s, turned by 0, 30, 60, 80 degrees: %s" % (kind, integrator, " ".join(shares)))
END
venv/bin/python turned.py | sed 's/\x1b\[[0-9;]*m//g' | tee seen
diff seen - <<'END'
rectangle, direct_projective, turned by 0, 30, 60, 80 degrees: 1.00 0.87 0.50 0.17
rectangle, prb_projective, turned by 0, 30, 60, 80 degrees: 1.00 0.87 0.50 0.17
disk, direct_projective, turned by 0, 30, 60, 80 degrees: 1.00 1.00 1.00 1.00
disk, prb_projective, turned by 0, 30, 60, 80 degrees: 1.00 1.00 1.00 1.00
END

#!/usr/bin/env bash
# Mitsuba 3.9.1, `direct_projective` with its default guiding (an octree): the derivative by an edge that moves gets lost as
# the view narrows, without a warning. A black disk of radius .5 hides a part of a white sky from the floor a unit below; all
# pixels see the point under its middle, where the derivative by the radius is -.512 (-.8 2 r / (1 + r^2)^2 for a floor of
# albedo .8). A view of 20 degrees has all of it; one of 2 degrees three quarters, one of .2 degrees a tenth. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check mitsuba==3.9.1 drjit==1.5.0 numpy==2.4.6 karellen-llvm-core==19.1.7
export DRJIT_LIBLLVM_PATH=$(find "$work/venv" -name 'libLLVM.so.*' | head -1)
cat > view.py <<'END'
import drjit as dr
import mitsuba as mi

mi.set_variant("llvm_ad_rgb")
mi.set_log_level(mi.LogLevel.Error)
T = mi.ScalarTransform4f


def share(fov):
    """Of the exact mean of the derivative by the disk's radius, .5, in 4 x 4 pixels."""
    film = {"type": "hdrfilm", "width": 4, "height": 4, "rfilter": {"type": "box"}}
    view = T().look_at([0, 0, 0.9], [0, 0, 0], [0, 1, 0])
    floor = {"type": "diffuse", "reflectance": 0.8}
    scene = mi.load_dict({
        "type": "scene",
        "sensor": {"type": "perspective", "fov": fov, "to_world": view, "film": film},
        "floor": {"type": "rectangle", "to_world": T().scale(50), "bsdf": floor},
        "disk": {
            "type": "disk",
            "to_world": T().translate([0, 0, 1]) @ T().scale(0.5),
            "bsdf": {"type": "diffuse", "reflectance": 0.0},
        },
        "sky": {"type": "constant"},
    })
    values = mi.traverse(scene)
    radius = mi.Float(0.5)
    dr.enable_grad(radius)
    values["disk.to_world"] = mi.Transform4f().translate([0, 0, 1]) @ mi.Transform4f().scale(radius)
    values.update()
    integrator = mi.load_dict({"type": "direct_projective"})
    picture = mi.render(scene, params=values, integrator=integrator, spp=65536, seed=1)
    dr.forward(radius)
    return dr.grad(picture).numpy().mean() / -0.512


for fov in (20, 2, 0.2):
    print("a view of %g degrees: %.1f of the derivative" % (fov, share(fov)))
END
venv/bin/python view.py | sed 's/\x1b\[[0-9;]*m//g' | tee seen
diff seen - <<'END'
a view of 20 degrees: 1.0 of the derivative
a view of 2 degrees: 0.8 of the derivative
a view of 0.2 degrees: 0.1 of the derivative
END
